// The one time that all figures of a flight show, and how it passes while the replay plays.

export class Clock {
  constructor(end_s) {
    this.end_s = end_s;
    this.time_s = 0;
    this.speed = 1;
    this.playing = false;
    this.listeners = [];
    this.closed = false;
  }

  listen(listener) {
    this.listeners.push(listener);
  }

  tell() {
    for (const listener of this.listeners) listener(this);
  }

  set(time_s) {
    this.time_s = Math.min(Math.max(time_s, 0), this.end_s);
    this.tell();
  }

  pause() {
    this.playing = false;
    this.tell();
  }

  toggle() {
    if (this.playing) return this.pause();
    if (this.time_s >= this.end_s) this.time_s = 0;
    this.playing = true;
    let last = performance.now();
    const step = (now) => {
      if (!this.playing || this.closed) return;
      this.time_s += (Math.max(0, now - last) / 1000) * this.speed;
      last = now;
      if (this.time_s >= this.end_s) {
        this.time_s = this.end_s;
        this.playing = false;
      }
      this.tell();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    this.tell();
  }

  close() {
    this.closed = true;
    this.playing = false;
    this.listeners = [];
  }
}
