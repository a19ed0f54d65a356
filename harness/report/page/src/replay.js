// The vehicle in space: its path, the reference, and where it is at the clock's time. Geometry is the vehicle's own.
import {
  AmbientLight, ArrowHelper, BoxGeometry, BufferAttribute, BufferGeometry, CanvasTexture, Color, CylinderGeometry, DirectionalLight, Group, Line,
  LineBasicMaterial, LineDashedMaterial, LineSegments, Mesh, MeshLambertMaterial, PerspectiveCamera, Quaternion, Scene, SphereGeometry, Sprite, SpriteMaterial, SRGBColorSpace,
  Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { lastAtOrBefore } from "./data.js";
import { colour, faultColour, palette } from "./theme.js";

const STATES = ["x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"];
const vector = (numbers) => new Vector3(...numbers);
const finite = (points) => points.filter((p) => Number.isFinite(p.x + p.y + p.z));

function path(flight, names) {
  if (!names.every((name) => flight.has(name))) return [];
  const rows = new Set(names.flatMap((name) => Array.from(flight.points(name).rows)));
  return finite(Array.from(rows).sort((a, b) => a - b).map((row) => Object.assign(vector(names.map((name) => flight.atRow(name, row))), { row })));
}

function niceStep(size) {
  const power = 10 ** Math.floor(Math.log10(size / 4));
  return [1, 2, 5, 10].map((f) => f * power).find((s) => size / s <= 6) ?? 10 * power;
}

function label(text) {
  const canvas = document.createElement("canvas");
  canvas.width = 192;
  canvas.height = 64;
  const ctx = canvas.getContext("2d");
  ctx.font = "40px system-ui, sans-serif";
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  ctx.fillStyle = colour("ink");
  ctx.fillText(text, 96, 32);
  const map = new CanvasTexture(canvas);
  // Its colours are those of the page: without this, they count as light and become paler.
  map.colorSpace = SRGBColorSpace;
  const sprite = new Sprite(new SpriteMaterial({ map, transparent: true, depthWrite: false, sizeAttenuation: false }));
  return sprite;
}

export class Replay {
  // Throws when there is no WebGL.
  constructor(flight, clock, box) {
    this.flight = flight;
    this.clock = clock;
    this.box = box;
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.domElement.setAttribute("role", "img");
    this.renderer.domElement.setAttribute("aria-label", "The path of the vehicle against its reference, and the vehicle on it");
    box.append(this.renderer.domElement);
    this.scene = new Scene();
    this.scene.background = new Color(colour("panel"));
    this.camera = new PerspectiveCamera(40, 1, 0.01, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.render());
    this.controls.addEventListener("start", () => (this.turned = true));
    this.follow = false;
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    const sun = new DirectionalLight(0xffffff, 1.8);
    sun.position.set(2, -3, 6);
    this.scene.add(sun);
    this.ground = this.paths = null;
    this.addPaths();
    this.addGround();
    this.addVehicle();
    this.resizer = new ResizeObserver(() => this.resize());
    this.resizer.observe(box);
    clock.listen(() => this.move());
    this.resize();
    this.move();
  }

  // A group in the place of an old one.
  renew(old) {
    old?.traverse((object) => {
      object.geometry?.dispose();
      object.material?.map?.dispose();
      object.material?.dispose();
    });
    old?.removeFromParent();
    const group = new Group();
    this.scene.add(group);
    return group;
  }

  // The flight has more rows.
  grow() {
    const [low, high] = [this.low, this.high];
    this.addPaths();
    const inside = this.low.x >= low.x && this.low.y >= low.y && this.high.x <= high.x && this.high.y <= high.y && this.high.z <= high.z;
    if (inside) [this.low, this.high] = [low, high];
    else {
      this.addGround();
      if (!this.follow) this.look();
    }
    this.move();
  }

  addPaths() {
    this.paths = this.renew(this.paths);
    this.flown = path(this.flight, ["x_m", "y_m", "z_m"]);
    // The whole reference of a flight that is still flown is known already.
    this.reference = this.flight.path?.length > 0 ? this.flight.path.map(vector) : path(this.flight, ["x_ref_m", "y_ref_m", "z_ref_m"]);
    const all = [...this.flown, ...this.reference];
    this.low = new Vector3(Infinity, Infinity, Infinity);
    this.high = new Vector3(-Infinity, -Infinity, -Infinity);
    for (const p of all) {
      // A vehicle that diverges must not make the rest invisible.
      if (this.reference.length > 0 && p.length() > 1000) continue;
      this.low.min(p);
      this.high.max(p);
    }
    if (!Number.isFinite(this.low.x)) {
      this.low.set(-1, -1, 0);
      this.high.set(1, 1, 1);
    }
    this.low.z = Math.min(this.low.z, 0);
    this.high.z = Math.max(this.high.z, 0.5);
    this.size = Math.max(this.high.clone().sub(this.low).length(), 1);
    const line = (points, material) => {
      const object = new Line(new BufferGeometry().setFromPoints(points), material);
      object.frustumCulled = false;
      this.paths.add(object);
      return object;
    };
    const dash = this.size / 120;
    line(this.reference, new LineDashedMaterial({ color: colour("muted"), dashSize: dash, gapSize: dash })).computeLineDistances();
    line(this.flown, new LineBasicMaterial({ color: palette()[0], transparent: true, opacity: 0.45 }));
    this.done = line(this.flown, new LineBasicMaterial({ color: palette()[0] }));
    const violation_s = this.flight.violation_s;
    if (violation_s !== null && this.flown.length > 0) {
      const ball = new Mesh(new SphereGeometry(this.size / 150), new MeshLambertMaterial({ color: colour("error") }));
      ball.position.set(...["x_m", "y_m", "z_m"].map((n) => this.flight.at(n, violation_s)));
      if (Number.isFinite(ball.position.length())) this.paths.add(ball);
    }
    for (const band of this.flight.bands.slice(0, 50)) this.addBand(band);
  }

  // The part of the path during which a fault was active, in its colour.
  addBand(band) {
    const first = lastAtOrBefore(this.flight.times_s, band.begin_s);
    const last = lastAtOrBefore(this.flight.times_s, band.end_s);
    const points = this.flown.filter((p) => p.row >= first && p.row <= last);
    if (points.length < 2) return;
    const material = new LineBasicMaterial({ color: faultColour(band.fault) });
    // Lines are one pixel wide: three of them are easier to see.
    for (const shift of [0, 1, -1]) {
      const object = new Line(new BufferGeometry().setFromPoints(points), material);
      object.position.z = (shift * this.size) / 600;
      this.paths.add(object);
    }
  }

  addGround() {
    this.ground = this.renew(this.ground);
    const step = niceStep(Math.max(this.high.x - this.low.x, this.high.y - this.low.y, 1));
    const from = [Math.floor(this.low.x / step) * step, Math.floor(this.low.y / step) * step];
    const to = [Math.ceil(this.high.x / step) * step || step, Math.ceil(this.high.y / step) * step || step];
    const points = [];
    for (let x = from[0]; x <= to[0] + step / 2; x += step) points.push(new Vector3(x, from[1], 0), new Vector3(x, to[1], 0));
    for (let y = from[1]; y <= to[1] + step / 2; y += step) points.push(new Vector3(from[0], y, 0), new Vector3(to[0], y, 0));
    const top = Math.ceil(this.high.z / step) * step || step;
    this.low.set(from[0], from[1], 0);
    this.high.set(to[0], to[1], top);
    points.push(new Vector3(from[0], to[1], 0), new Vector3(from[0], to[1], top));
    this.ground.add(new LineSegments(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: colour("grid") })));
    const height = this.size / 34;
    const put = (text, x, y, z) => {
      const sprite = label(text);
      sprite.position.set(x, y, z);
      this.ground.add(sprite);
    };
    const at = (v) => `${+v.toFixed(3)}`;
    for (let x = from[0]; x <= to[0] + step / 2; x += step) put(at(x), x, from[1] - height, 0);
    for (let y = from[1]; y <= to[1] + step / 2; y += step) put(at(y), to[0] + height * 1.2, y, 0);
    for (let z = step; z <= top + step / 2; z += step) put(at(z), from[0] - height * 1.2, to[1], z);
    put("x [m]", (from[0] + to[0]) / 2, from[1] - 2.4 * height, 0);
    put("y [m]", to[0] + 3 * height, (from[1] + to[1]) / 2, 0);
    put("z [m]", from[0] - height * 1.2, to[1], top + 1.2 * height);
    this.fitLabels();
  }

  // Labels are as high as a share of the picture's height; in a narrow picture of its width, or they would cover each other.
  fitLabels() {
    const share = Math.min(1, Math.max(0.55, this.camera.aspect));
    for (const object of this.ground.children) if (object instanceof Sprite) object.scale.set(0.075 * share, 0.025 * share, 1);
  }

  addVehicle() {
    this.vehicle = new Group();
    this.rotors = [];
    this.scene.add(this.vehicle);
    const shape = this.flight.vehicle ?? { body_size_m: [0.3, 0.1, 0.1], body_position_m: [0, 0, 0], rotors: [] };
    const body = new MeshLambertMaterial({ color: colour("body") });
    const hull = new Mesh(new BoxGeometry(...shape.body_size_m.map((s) => Math.max(s, 0.01))), body);
    hull.position.set(...shape.body_position_m);
    this.vehicle.add(hull);
    // Where is its front?
    const nose = new Mesh(new SphereGeometry(Math.min(...shape.body_size_m) / 4), new MeshLambertMaterial({ color: palette()[1] }));
    nose.position.set(shape.body_position_m[0] + shape.body_size_m[0] / 2, shape.body_position_m[1], shape.body_position_m[2]);
    this.vehicle.add(nose);
    const reach = Math.max(0.2, ...shape.rotors.map((r) => vector(r.position_m).length()));
    const colourOf = (i) => palette()[(i + 2) % palette().length];
    shape.rotors.forEach((rotor, i) => {
      const point = vector(rotor.hinge_point_m);
      const hinge = new Group();
      hinge.position.copy(point);
      const offset = vector(rotor.position_m).sub(point);
      const axis = vector(rotor.thrust_axis).normalize();
      const disc = new Mesh(new CylinderGeometry(reach * 0.42, reach * 0.42, reach * 0.03, 28), new MeshLambertMaterial({ color: colourOf(i), transparent: true, opacity: 0.55 }));
      disc.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), axis));
      disc.position.copy(offset).addScaledVector(axis, reach * 0.08);
      const arrow = new ArrowHelper(axis, disc.position, 0.001, new Color(colourOf(i)));
      const arm = new Line(new BufferGeometry().setFromPoints([new Vector3(), point]), new LineBasicMaterial({ color: colour("ink") }));
      hinge.add(disc, arrow);
      this.vehicle.add(hinge, arm);
      this.rotors.push({ rotor, hinge, arrow, axis: vector(rotor.hinge_axis).normalize(), length: reach * 2.2 });
    });
    this.trueReach = reach;
    this.enlarge(true);
  }

  // The vehicle is small beside its path.
  enlarge(large) {
    this.vehicle.scale.setScalar(large ? Math.max(1, this.size / 24 / this.trueReach) : 1);
    this.move?.call(this);
  }

  // From nearby, wherever it goes.
  followVehicle(on) {
    this.follow = on;
    if (!on) return this.look();
    const away = this.camera.position.clone().sub(this.controls.target).normalize();
    this.controls.target.copy(this.vehicle.position);
    this.camera.position.copy(this.vehicle.position).addScaledVector(away, this.trueReach * this.vehicle.scale.x * 9);
    this.controls.update();
    this.render();
  }

  look() {
    const { camera, controls, low, high } = this;
    const towards = new Vector3(0.5, -0.74, 0.42).normalize();
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => new Vector3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z));
    let distance = this.size * 1.5;
    controls.target.copy(low).add(high).multiplyScalar(0.5);
    camera.near = this.size / 1000;
    camera.far = this.size * 40;
    camera.updateProjectionMatrix();
    // Nearer or farther, and aside, until all of the space fills the picture.
    for (let i = 0; i < 12; ++i) {
      camera.position.copy(controls.target).addScaledVector(towards, distance);
      camera.lookAt(controls.target);
      camera.updateMatrixWorld();
      const seen = corners.map((corner) => corner.clone().project(camera));
      const [left, right] = [Math.min(...seen.map((p) => p.x)), Math.max(...seen.map((p) => p.x))];
      const [bottom, top] = [Math.min(...seen.map((p) => p.y)), Math.max(...seen.map((p) => p.y))];
      const half = distance * Math.tan((camera.fov * Math.PI) / 360);
      const shift = new Vector3((((left + right) / 2) * half) * camera.aspect, ((bottom + top) / 2) * half, 0).applyQuaternion(camera.quaternion);
      controls.target.add(shift);
      distance *= Math.max(right - left, top - bottom) / 2 / 0.88;
    }
    camera.position.copy(controls.target).addScaledVector(towards, distance);
    controls.update();
    this.render();
  }

  resize() {
    const width = Math.max(this.box.clientWidth, 50);
    const height = Math.max(this.box.clientHeight, 50);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.fitLabels();
    // The whole path stays in the picture until the reader looks at it in another way.
    if (!this.turned && !this.follow) this.look();
    else this.render();
  }

  move() {
    if (!this.vehicle || this.flight.times_s.length === 0) return;
    const t = this.clock.time_s;
    const [x, y, z, roll, pitch, yaw] = STATES.map((name) => this.flight.at(name, t));
    if (!Number.isFinite(x + y + z + roll + pitch + yaw)) return;
    if (this.follow) {
      const shift = new Vector3(x, y, z).sub(this.vehicle.position);
      this.camera.position.add(shift);
      this.controls.target.add(shift);
    }
    this.vehicle.position.set(x, y, z);
    this.vehicle.rotation.set(roll, pitch, yaw, "ZYX");
    for (const { rotor, hinge, arrow, axis, length } of this.rotors) {
      const angle = rotor.angle ? this.flight.at(rotor.angle, t) : 0;
      if (Number.isFinite(angle)) hinge.quaternion.setFromAxisAngle(axis, angle);
      const force = rotor.force ? this.flight.at(rotor.force, t) : 0;
      const share = Number.isFinite(force) && rotor.force_max_n > 0 ? Math.min(Math.max(force / rotor.force_max_n, 0), 1) : 0;
      arrow.visible = share > 0;
      arrow.setLength(Math.max(share * length, 1e-3), length * 0.12, length * 0.08);
    }
    const row = lastAtOrBefore(this.flight.times_s, t);
    let count = this.flown.findIndex((p) => p.row > row);
    if (count < 0) count = this.flown.length;
    this.done.geometry.setDrawRange(0, count);
    this.render();
  }

  render() {
    if (!this.closed) this.renderer.render(this.scene, this.camera);
  }

  close() {
    this.closed = true;
    this.resizer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
