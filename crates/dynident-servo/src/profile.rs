//! Set points that follow a command with limited acceleration and speed.
//!
//! Many servos do not control to the command directly. A profile generator moves their set point to the command in the
//! shortest time, with an acceleration and a speed from two registers (Feetech "acceleration" and "goal speed",
//! Dynamixel "profile acceleration" and "profile velocity"). For step commands, the profile adds a time that grows with
//! the square root of the step. For sines, it adds a phase lag of almost 90 degrees above a frequency that depends on
//! the amplitude.
//!
//! In each cycle of length `h`, the generator selects the largest velocity from which the set point can still stop at
//! the command, at the distance `e`:
//!
//! ```text
//! w = sign(e) min(√(2 a |e| + (a h / 2)²) - a h / 2, |e| / h, speed)        v' = v + clip(w - v, ±a h)        z' = z + h v'
//! ```
//!
//! This is the time-optimal profile of a double integrator in discrete time.

/// Length of a cycle of the profile generator, s: servos have a control period of about 1 ms.
const CYCLE_S: f64 = 1e-3;

/// A set point over time: linear between cycles, constant before the first and after the last.
#[derive(Debug)]
pub(crate) struct Profile {
    start_s: f64,
    values: Vec<f64>,
    /// Integral of the set point from the start to each cycle.
    integral: Vec<f64>,
}

/// The profile for held commands with limits of acceleration and speed. It starts at rest at the first command.
pub(crate) fn profile(times_s: &[f64], commands: &[f64], [acceleration, speed]: [f64; 2]) -> Profile {
    let start_s = times_s[0];
    let cycles = ((times_s[times_s.len() - 1] - start_s) / CYCLE_S).ceil() as usize + 1;
    let (mut values, mut integral) = (Vec::with_capacity(cycles), Vec::with_capacity(cycles));
    let (mut z, mut v, mut sum, mut at) = (commands[0], 0.0_f64, 0.0, 0);
    let change = acceleration * CYCLE_S;
    for cycle in 0..cycles {
        values.push(z);
        integral.push(sum);
        let now = start_s + CYCLE_S * cycle as f64;
        while at + 1 < times_s.len() && times_s[at + 1] <= now {
            at += 1;
        }
        let distance = commands[at] - z;
        let size = distance.abs();
        // Without a limit on the acceleration, only the speed is limited.
        let stopping = if change.is_finite() {
            (2.0 * acceleration * size + 0.25 * change * change).sqrt() - 0.5 * change
        } else {
            f64::INFINITY
        };
        let wanted = stopping.min(size / CYCLE_S).min(speed).copysign(distance);
        v += (wanted - v).clamp(-change, change);
        sum += CYCLE_S * (z + 0.5 * CYCLE_S * v);
        z += CYCLE_S * v;
    }
    Profile { start_s, values, integral }
}

impl Profile {
    /// Index of the cycle that contains a time, and the part of the cycle that has passed.
    fn place(&self, time_s: f64) -> (usize, f64) {
        let place = ((time_s - self.start_s) / CYCLE_S).clamp(0.0, (self.values.len() - 1) as f64);
        (place as usize, place.fract())
    }

    /// The set point at a time.
    pub(crate) fn at(&self, time_s: f64) -> f64 {
        let (cycle, part) = self.place(time_s);
        let next = self.values[(cycle + 1).min(self.values.len() - 1)];
        self.values[cycle] + part * (next - self.values[cycle])
    }

    /// Integral of the set point from the start to a time.
    fn integral_to(&self, time_s: f64) -> f64 {
        let (cycle, part) = self.place(time_s);
        let until = self.integral[cycle] + 0.5 * part * CYCLE_S * (self.values[cycle] + self.at(time_s));
        let end_s = self.start_s + CYCLE_S * (self.values.len() - 1) as f64;
        // Before the start, the set point has its first value.
        let before = (time_s - self.start_s).min(0.0) * self.values[0];
        until + before + (time_s - end_s).max(0.0) * self.values[self.values.len() - 1]
    }

    /// Mean set point from `start_s` to `end_s`.
    pub(crate) fn mean(&self, start_s: f64, end_s: f64) -> f64 {
        (self.integral_to(end_s) - self.integral_to(start_s)) / (end_s - start_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of 0.4 rad at 0.1 s with an acceleration of 40 rad/s², time-optimal without and with a limit on the
    /// speed.
    #[test]
    fn a_step_takes_the_shortest_time() {
        let (times, commands) = ([0.0, 0.1, 1.0], [0.0, 0.4, 0.4]);
        // Triangular velocity: duration 2 √(d / a) = 0.2 s, highest velocity √(d a) = 4 rad/s.
        let free = profile(&times, &commands, [40.0, f64::INFINITY]);
        assert!((free.at(0.2) - 0.2).abs() < 0.005 && (free.at(0.1) - 0.0).abs() < 1e-9, "{}", free.at(0.2));
        assert!(free.at(0.29) < 0.4 - 1e-4 && (free.at(0.304) - 0.4).abs() < 1e-9, "{}", free.at(0.304));
        // Trapezoidal velocity with 2 rad/s: duration d / s + s / a = 0.25 s.
        let slow = profile(&times, &commands, [40.0, 2.0]);
        assert!(slow.at(0.34) < 0.4 - 1e-4 && (slow.at(0.354) - 0.4).abs() < 1e-9, "{}", slow.at(0.354));
        // Ramp.
        let ramp = profile(&times, &commands, [f64::INFINITY, 2.0]);
        assert!((ramp.at(0.2) - 0.2).abs() < 0.003 && (ramp.at(0.302) - 0.4).abs() < 1e-9, "{}", ramp.at(0.2));
        // No overshoot.
        assert!([free, slow, ramp].iter().all(|own| own.values.iter().all(|z| (0.0..=0.4 + 1e-12).contains(z))));
    }

    #[test]
    fn means_are_integrals_of_the_set_point() {
        let times: Vec<f64> = (0..40).map(|k| 0.02 * f64::from(k)).collect();
        let commands: Vec<f64> = times.iter().map(|t| 0.5 * (9.0 * t).sin()).collect();
        let own = profile(&times, &commands, [30.0, 3.0]);
        for (from, to) in [(-0.5, 0.1), (0.2134, 0.2159), (0.3, 0.31), (0.7, 1.9)] {
            let parts = 20_000;
            let of = |k: usize| own.at(from + (to - from) * (k as f64 + 0.5) / parts as f64);
            let sum: f64 = (0..parts).map(of).sum();
            assert!((own.mean(from, to) - sum / parts as f64).abs() < 1e-7, "{from} to {to}");
        }
    }

    /// The phase of a sine whose acceleration is above the limit falls behind.
    #[test]
    fn fast_sines_lag() {
        let times: Vec<f64> = (0..3000).map(|k| 0.001 * f64::from(k)).collect();
        let lag = |frequency: f64| {
            let omega = core::f64::consts::TAU * frequency;
            let commands: Vec<f64> = times.iter().map(|t| 0.15 * (omega * t).sin()).collect();
            let own = profile(&times, &commands, [39.0, f64::INFINITY]);
            let part =
                |phase: f64| (1000..3000).map(|k| own.at(times[k]) * (omega * times[k] + phase).sin()).sum::<f64>();
            (-part(core::f64::consts::FRAC_PI_2)).atan2(part(0.0)).to_degrees()
        };
        // 0.15 (2π f)² is 24 rad/s² at 2 Hz and 59 rad/s² at 3.16 Hz.
        let (slow, fast) = (lag(2.0), lag(3.16));
        assert!(slow < 30.0 && fast > 60.0, "{slow} and {fast} degrees");
    }
}
