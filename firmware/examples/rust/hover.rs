//! A flight firmware in Rust, with its standard library alone, as a program in lockstep (docs/program.md):
//!
//!     rustc -O --edition 2021 firmware/examples/rust/hover.rs -o rust_hover
//!     tiltproof run scenarios/acceptance/sound --client program:./rust_hover
//!
//! It flies any vehicle in the protocol `paper`, with the gain that the harness designs: u = u_hover - K (x - x_ref).

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;

const HELLO: u8 = 1;
const GRANT: u8 = 2;
const BYTES: u8 = 3;
const RESET: u8 = 4;
const END: u8 = 6;
const READY: u8 = 0x81;
const WAITING: u8 = 0x82;
const TRANSMIT: u8 = 0x83;

const MAIN: usize = 0;
const PERIOD_NS: i64 = 12_000_000;
const PERIOD_S: f64 = 0.012;
const REGULATED: [usize; 4] = [0, 1, 2, 5]; // x, y, z and yaw: the errors that are integrated

/// The socket: messages in, and what is sent with the next answer.
struct Program {
    socket: UnixStream,
    out: Vec<u8>,
}

impl Program {
    /// Kind, UART and body; None when the harness is gone.
    fn next(&mut self) -> Option<(u8, usize, Vec<u8>)> {
        let mut head = [0u8; 8];
        self.socket.read_exact(&mut head).ok()?;
        let mut body = vec![0u8; u32::from_le_bytes(head[..4].try_into().unwrap()) as usize];
        self.socket.read_exact(&mut body).ok()?;
        Some((head[4], head[5] as usize, body))
    }
    fn put(&mut self, kind: u8, body: &[&[u8]]) {
        let size: usize = body.iter().map(|part| part.len()).sum();
        self.out.extend_from_slice(&(size as u32).to_le_bytes());
        self.out.extend_from_slice(&[kind, 0, 0, 0]);
        body.iter().for_each(|part| self.out.extend_from_slice(part));
    }
    fn flush(&mut self) {
        let _ = self.socket.write_all(&self.out); // the next read finds the end
        self.out.clear();
    }
}

/// The numbers that follow `"key":` in a JSON text, wherever it stands.
fn numbers<'a>(json: &'a str, key: &'a str) -> impl Iterator<Item = f64> + 'a {
    let pattern = format!("\"{key}\":");
    json.match_indices(&pattern).map(move |(at, found)| number(&json[at + found.len()..])).collect::<Vec<_>>().into_iter()
}
fn number(text: &str) -> f64 {
    let text = text.trim_start();
    let end = text.find(|c: char| !"+-.eE0123456789".contains(c)).unwrap_or(text.len());
    text[..end].parse().unwrap_or(f64::NAN)
}
/// The text between the brackets behind `"key":`.
fn list<'a>(json: &'a str, key: &str) -> &'a str {
    let begin = json.find(&format!("\"{key}\": [")).expect(key) + key.len() + 4;
    let mut depth = 0;
    let end = json[begin..].find(|c: char| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        depth == 0
    });
    &json[begin + 1..begin + end.expect(key)]
}

struct Input {
    hover: f64,
    min: f64,
    max: f64,
}

/// What the parameters say of the vehicle.
struct Vehicle {
    hover: Vec<f64>, // of each signal of a reply
    inputs: Vec<Input>,
    gain: Vec<Vec<f64>>,
    world_rates: bool,
}

impl Vehicle {
    fn read(json: &str) -> Vehicle {
        let inputs = list(json, "inputs");
        let (min, max): (Vec<_>, Vec<_>) = (numbers(inputs, "min").collect(), numbers(inputs, "max").collect());
        let hover: Vec<f64> = numbers(inputs, "hover").collect();
        Vehicle {
            hover: numbers(list(json, "signals"), "hover").collect(),
            inputs: (0..hover.len()).map(|i| Input { hover: hover[i], min: min[i], max: max[i] }).collect(),
            gain: list(json, "gain").split('[').skip(1).map(|row| row.trim_end_matches(&[']', ',', ' '][..]).split(',').map(number).collect()).collect(),
            world_rates: json.contains("\"angular_rates\": \"world\""),
        }
    }
}

fn fletcher16(payload: &[u8]) -> [u8; 2] {
    let (mut first, mut second) = (0u32, 0u32);
    for &byte in payload {
        first = (first + u32::from(byte)) % 255;
        second = (second + first) % 255;
    }
    [first as u8, second as u8]
}

fn frame(values: &[f32]) -> Vec<u8> {
    let mut content: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    content.extend_from_slice(&fletcher16(&content));
    let mut out = vec![0x7e];
    for byte in content {
        if byte == 0x7e || byte == 0x7d {
            out.extend_from_slice(&[0x7d, byte ^ 0x20]);
        } else {
            out.push(byte);
        }
    }
    out.push(0x7e);
    out
}

/// Bytes of one line; gives the numbers of each whole frame with a right check.
#[derive(Default)]
struct Receiver {
    content: Vec<u8>,
    escaped: bool,
}

impl Receiver {
    fn take(&mut self, byte: u8) -> Option<Vec<f64>> {
        if byte != 0x7e {
            if byte == 0x7d {
                self.escaped = true;
            } else if self.content.len() < 256 {
                self.content.push(if self.escaped { byte ^ 0x20 } else { byte });
                self.escaped = false;
            }
            return None;
        }
        let content = std::mem::take(&mut self.content);
        if std::mem::take(&mut self.escaped) || content.len() < 6 || content.len() % 4 != 2 {
            return None;
        }
        let (payload, check) = content.split_at(content.len() - 2);
        let values = payload.chunks(4).map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().unwrap())));
        (check == fletcher16(payload)).then(|| values.collect())
    }
}

/// All state of the board: a reset makes a new one.
#[derive(Default)]
struct Firmware {
    receivers: [Receiver; 2],
    reference: Option<Vec<f64>>,
    integrals: [f64; 4],
    last_errors: [f64; 4],
    tick_ns: Option<i64>, // of the next request; none: it has not started
}

/// Two components along x and y of the world, along forward and left of the heading.
fn turn(heading: f64, xy: &mut [f64]) {
    let (sine, cosine) = heading.sin_cos();
    (xy[0], xy[1]) = (cosine * xy[0] + sine * xy[1], cosine * xy[1] - sine * xy[0]);
}

impl Firmware {
    fn step(&mut self, vehicle: &Vehicle, sensors: &[f64]) -> Vec<f32> {
        let hold = || vec![sensors[0], sensors[1], sensors[2], sensors[5], 0.0, 0.0, 0.0];
        let reference = self.reference.get_or_insert_with(hold);
        let mut errors: Vec<f64> = sensors.iter().zip(&vehicle.hover).map(|(is, hover)| is - hover).collect();
        let half = errors.len() / 2;
        for (place, wanted) in [0, 1, 2, 5, half, half + 1, half + 2].into_iter().zip(reference.iter()) {
            errors[place] = sensors[place] - wanted;
        }
        errors[5] = (errors[5] + std::f64::consts::PI).rem_euclid(2.0 * std::f64::consts::PI) - std::f64::consts::PI;
        for (i, &place) in REGULATED.iter().enumerate() {
            self.integrals[i] += PERIOD_S / 2.0 * (errors[place] + self.last_errors[i]);
            self.last_errors[i] = errors[place];
        }
        let (heading, mut integrals) = (sensors[5], self.integrals);
        turn(heading, &mut integrals[..2]);
        turn(heading, &mut errors[..2]);
        turn(heading, &mut errors[half..half + 2]);
        if vehicle.world_rates {
            turn(heading, &mut errors[half + 3..half + 5]);
        }
        errors.extend_from_slice(&integrals);
        let command = |(input, row): (&Input, &Vec<f64>)| {
            let sum: f64 = row.iter().zip(&errors).map(|(k, error)| k * error).sum();
            (input.hover - sum).clamp(input.min, input.max) as f32
        };
        std::iter::once(3.0).chain(vehicle.inputs.iter().zip(&vehicle.gain).map(command)).collect()
    }

    fn receive(&mut self, program: &mut Program, vehicle: &Vehicle, uart: usize, now: &[u8], bytes: &[u8]) {
        for &byte in bytes {
            match self.receivers[uart].take(byte) {
                Some(sensors) if uart == MAIN && sensors.len() == vehicle.hover.len() => {
                    let actuators = self.step(vehicle, &sensors);
                    program.put(TRANSMIT, &[now, &frame(&actuators)]);
                }
                Some(reference) if uart != MAIN && reference.len() == 7 => self.reference = Some(reference),
                _ => {}
            }
        }
    }

    /// Until when it waits.
    fn run(&mut self, program: &mut Program, now_ns: i64) -> i64 {
        let mut tick_ns = self.tick_ns.unwrap_or(now_ns);
        if self.tick_ns.is_none() {
            program.put(TRANSMIT, &[&now_ns.to_le_bytes(), &frame(&[1.0])]);
        }
        if now_ns >= tick_ns {
            program.put(TRANSMIT, &[&now_ns.to_le_bytes(), &frame(&[2.0])]);
            tick_ns += PERIOD_NS;
        }
        self.tick_ns = Some(tick_ns);
        tick_ns
    }
}

fn parameters(hello: &[u8]) -> String {
    let word = |at: usize| u32::from_le_bytes(hello[at..at + 4].try_into().unwrap()) as usize;
    let mut at = 8 + 8 * word(4);
    for _ in 0..2 {
        at += 4 + word(at); // firmware, dialect
    }
    String::from_utf8_lossy(&hello[at + 4..at + 4 + word(at)]).into_owned()
}

fn main() {
    let path = std::env::var("TILTPROOF_SOCKET").expect("fly this with `tiltproof run ... --client program:CMD`");
    let mut program = Program { socket: UnixStream::connect(path).expect("the socket of tiltproof"), out: vec![] };
    let (kind, _, hello) = program.next().expect("a greeting");
    assert_eq!(kind, HELLO);
    let vehicle = Vehicle::read(&parameters(&hello));
    program.put(READY, &[&1u32.to_le_bytes()]);
    program.flush();
    let mut firmware = Firmware::default();
    while let Some((kind, uart, body)) = program.next() {
        match kind {
            BYTES => firmware.receive(&mut program, &vehicle, uart, &body[..8], &body[8..]),
            GRANT | RESET => {
                if kind == RESET {
                    firmware = Firmware::default();
                }
                let until_ns = firmware.run(&mut program, i64::from_le_bytes(body[..8].try_into().unwrap()));
                program.put(WAITING, &[&until_ns.to_le_bytes()]);
                program.flush();
            }
            END => return,
            _ => {}
        }
    }
}
