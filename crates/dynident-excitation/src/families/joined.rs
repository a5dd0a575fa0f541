//! Sequence of families in one experiment.

use super::error::{FamilyError, require};
use super::polynomials::quintic_hermite;
use crate::family::{Family, check_shapes};
use crate::motion::{Motion, MotionAdjoint};
use core::ops::Range;
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

const NAME: &str = "joined";

/// Connections between the members of a [`FamilySequence`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JoinedSettings {
    /// Duration of each connecting move, s. Default 2.
    pub move_s: f64,
    /// Posture at rest from which the experiment starts, rad (m). Default: the start of the first member.
    pub start: Option<Vec<f64>>,
    /// Posture at rest at which the experiment ends. Default: the end of the last member.
    pub end: Option<Vec<f64>>,
}

impl Default for JoinedSettings {
    fn default() -> Self {
        Self { move_s: 2.0, start: None, end: None }
    }
}

/// A sequence of families (members), with a connecting move between each two, and moves from and to given postures.
///
/// A move is the quintic polynomial that matches position, velocity and acceleration at both ends, so that a plain
/// periodic series can be a member, too. Between members at rest it is the minimum-jerk move. Velocity and
/// acceleration are continuous everywhere if they are continuous within the members.
///
/// Parameters: first those of the first member (all its joints), then those of the second, and so on.
#[derive(Debug)]
pub struct FamilySequence {
    members: Vec<Box<dyn Family>>,
    settings: JoinedSettings,
    joints: usize,
}

/// A member, or the move before member `n`; if `n` is the number of members, the last move.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Piece {
    Member(usize),
    MoveTo(usize),
}

/// Position, velocity and acceleration of all joints at both ends of one member, as a [`Motion`] of two samples.
fn ends_of(member: &dyn Family, parameters: &[f64]) -> Motion {
    let mut ends = Motion::default();
    member.motion(parameters, &[0.0, member.duration_s()], &mut ends);
    ends
}

impl FamilySequence {
    /// Creates the sequence.
    ///
    /// # Errors
    /// No members, different numbers of joints, a posture that is not finite, or a move without duration.
    pub fn new(members: Vec<Box<dyn Family>>, settings: &JoinedSettings) -> Result<Self, FamilyError> {
        let move_s = settings.move_s;
        require((1e-3..=1e7).contains(&move_s), NAME, "move_s", move_s, "give between a millisecond and 1e7 seconds")?;
        let Some(first) = members.first() else {
            return Err(FamilyError::Length { family: NAME, what: "members", expected: 1, found: 0 });
        };
        let joints = first.joints();
        let lengths = members
            .iter()
            .map(|member| ("joints of a member", member.joints()))
            .chain(settings.start.iter().map(|posture| ("start", posture.len())))
            .chain(settings.end.iter().map(|posture| ("end", posture.len())));
        for (what, found) in lengths {
            if found != joints {
                return Err(FamilyError::Length { family: NAME, what, expected: joints, found });
            }
        }
        for (setting, posture) in [("start", &settings.start), ("end", &settings.end)] {
            for &q in posture.iter().flatten() {
                require(q.is_finite(), NAME, setting, q, "give finite positions")?;
            }
        }
        Ok(Self { members, settings: settings.clone(), joints })
    }

    /// Start and end of each member, s.
    pub fn spans(&self) -> Vec<[f64; 2]> {
        self.pieces().into_iter().filter(|(piece, _)| matches!(piece, Piece::Member(_))).map(|(_, span)| span).collect()
    }

    /// The members, in order.
    pub fn members(&self) -> &[Box<dyn Family>] {
        &self.members
    }

    fn pieces(&self) -> Vec<(Piece, [f64; 2])> {
        let mut pieces = Vec::new();
        let mut now = 0.0;
        let mut push = |piece, length| {
            pieces.push((piece, [now, now + length]));
            now += length;
        };
        for (index, member) in self.members.iter().enumerate() {
            if index > 0 || self.settings.start.is_some() {
                push(Piece::MoveTo(index), self.settings.move_s);
            }
            push(Piece::Member(index), member.duration_s());
        }
        if self.settings.end.is_some() {
            push(Piece::MoveTo(self.members.len()), self.settings.move_s);
        }
        pieces
    }

    fn split(&self, times_s: &[f64]) -> Vec<(Piece, Vec<usize>, Vec<f64>)> {
        let pieces = self.pieces();
        let mut split: Vec<_> = pieces.iter().map(|(piece, _)| (*piece, Vec::new(), Vec::new())).collect();
        for (sample, &time) in times_s.iter().enumerate() {
            let at = pieces.iter().position(|(_, span)| time < span[1]).unwrap_or(pieces.len() - 1);
            let [from, to] = pieces[at].1;
            split[at].1.push(sample);
            split[at].2.push((time - from).clamp(0.0, to - from));
        }
        split
    }

    fn ranges(&self) -> Vec<Range<usize>> {
        let mut from = 0;
        self.members
            .iter()
            .map(|member| {
                let range = from..from + member.parameters();
                from = range.end;
                range
            })
            .collect()
    }

    /// Boundary values of one joint in the move to member `index`, as the six weights of [`quintic_hermite`].
    fn boundary(&self, ends: &[Motion], index: usize, joint: usize) -> [f64; 6] {
        let side = |member: Option<usize>, posture: &Option<Vec<f64>>, last: usize| match member {
            Some(member) => {
                let at = 2 * joint + last;
                [ends[member].q[at], ends[member].dq[at], ends[member].ddq[at]]
            }
            None => [posture.as_ref().map_or(0.0, |q| q[joint]), 0.0, 0.0],
        };
        let [q0, dq0, ddq0] = side(index.checked_sub(1), &self.settings.start, 1);
        let [q1, dq1, ddq1] = side((index < self.members.len()).then_some(index), &self.settings.end, 0);
        [q0, dq0, ddq0, q1, dq1, ddq1]
    }

    fn ends(&self, parameters: &[f64]) -> Vec<Motion> {
        self.members.iter().zip(self.ranges()).map(|(member, own)| ends_of(&**member, &parameters[own])).collect()
    }
}

impl Family for FamilySequence {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.joints
    }

    fn duration_s(&self) -> f64 {
        self.pieces().last().map_or(0.0, |(_, span)| span[1])
    }

    fn parameters(&self) -> usize {
        self.members.iter().map(|member| member.parameters()).sum()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.members.iter().flat_map(|member| member.bounds()).collect()
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        self.members.iter().flat_map(|member| member.random(ranges, speeds, random)).collect()
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), self.parameters(), "parameters of {NAME}");
        out.reset(self.joints, times_s.len());
        let (ends, own) = (self.ends(parameters), self.ranges());
        let mut part = Motion::default();
        for (piece, samples, times) in self.split(times_s) {
            match piece {
                Piece::Member(index) => {
                    self.members[index].motion(&parameters[own[index].clone()], &times, &mut part);
                    for joint in 0..self.joints {
                        for (to, from) in out.arrays_mut().into_iter().zip(part.arrays()) {
                            for (from, &sample) in from[part.of(joint)].iter().zip(&samples) {
                                to[joint * times_s.len() + sample] = *from;
                            }
                        }
                    }
                }
                Piece::MoveTo(index) => {
                    for joint in 0..self.joints {
                        let weights = self.boundary(&ends, index, joint);
                        for (&time, &sample) in times.iter().zip(&samples) {
                            let to = joint * times_s.len() + sample;
                            let functions = quintic_hermite(time, self.settings.move_s);
                            for (order, out) in out.arrays_mut().into_iter().enumerate() {
                                out[to] = functions.iter().zip(weights).map(|(f, weight)| f[order] * weight).sum();
                            }
                        }
                    }
                }
            }
        }
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        check_shapes(self, parameters, times_s, adjoint, gradient);
        let own = self.ranges();
        let arrays = adjoint.arrays();
        // Adjoint of both ends of each member, propagated through the moves.
        let mut ends = vec![Motion::default(); self.members.len()];
        for end in &mut ends {
            end.reset(self.joints, 2);
        }
        let mut part = Motion::default();
        for (piece, samples, times) in self.split(times_s) {
            match piece {
                Piece::Member(index) => {
                    part.reset(self.joints, times.len());
                    for joint in 0..self.joints {
                        let own = part.of(joint);
                        for (to, from) in part.arrays_mut().into_iter().zip(arrays) {
                            for (to, &sample) in to[own.clone()].iter_mut().zip(&samples) {
                                *to = from[joint * times_s.len() + sample];
                            }
                        }
                    }
                    let range = own[index].clone();
                    self.members[index].apply_adjoint(&parameters[range.clone()], &times, &part, &mut gradient[range]);
                }
                Piece::MoveTo(index) => {
                    for (&time, &sample) in times.iter().zip(&samples) {
                        let functions = quintic_hermite(time, self.settings.move_s);
                        for joint in 0..self.joints {
                            let from = joint * times_s.len() + sample;
                            let pull = |weight: usize| -> f64 {
                                functions[weight].iter().zip(arrays).map(|(f, array)| f * array[from]).sum()
                            };
                            for (member, weight, at) in
                                [(index.checked_sub(1), 0, 2 * joint + 1), (Some(index), 3, 2 * joint)]
                            {
                                if let Some(end) = member.and_then(|member| ends.get_mut(member)) {
                                    end.q[at] += pull(weight);
                                    end.dq[at] += pull(weight + 1);
                                    end.ddq[at] += pull(weight + 2);
                                }
                            }
                        }
                    }
                }
            }
        }
        for ((member, range), end) in self.members.iter().zip(own).zip(&ends) {
            let times = [0.0, member.duration_s()];
            member.apply_adjoint(&parameters[range.clone()], &times, end, &mut gradient[range]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{
        Fourier, FourierSettings, FrictionLadder, FrictionLadderSettings, LogisticStrokes, LogisticStrokesSettings,
        StaticPostures, StaticPosturesSettings, check,
    };
    use proptest::prelude::*;

    fn members() -> Vec<Box<dyn Family>> {
        vec![
            Box::new(LogisticStrokes::new(2, 5.0, &LogisticStrokesSettings::default()).unwrap()),
            Box::new(Fourier::new(2, 6.0, &FourierSettings { rest: false, ..Default::default() }).unwrap()),
            Box::new(StaticPostures::new(2, 20.0, &StaticPosturesSettings { postures: 3, rest_part: 0.5 }).unwrap()),
        ]
    }

    fn at(seed: u64, family: &FamilySequence) -> Vec<f64> {
        family.random(&[[-1.0, 1.0], [-2.0, 0.5]], &[1.0, 2.0], &mut Random::new(seed))
    }

    /// Start and end postures are at rest, members start at the right times, and q, q̇ and q̈ are continuous at every
    /// join: the change over 2e-9 s is at most rate × 2e-9 (rates here are below 1e3).
    #[test]
    fn joins_are_smooth() {
        let settings = JoinedSettings { move_s: 1.5, start: Some(vec![0.1, 0.2]), end: Some(vec![-0.3, 0.4]) };
        let family = FamilySequence::new(members(), &settings).unwrap();
        let parameters = at(1, &family);
        let duration = family.duration_s();
        assert!((duration - (5.0 + 6.0 + 20.0 + 4.0 * 1.5)).abs() < 1e-12);
        let mut times = vec![0.0, duration];
        for [from, to] in family.spans() {
            times.extend([from - 1e-9, from + 1e-9, to - 1e-9, to + 1e-9]);
        }
        let mut motion = Motion::default();
        family.motion(&parameters, &times, &mut motion);
        for joint in 0..2 {
            let range = motion.of(joint);
            let q = &motion.q[range.clone()];
            assert!((q[0] - [0.1, 0.2][joint]).abs() < 1e-15 && (q[1] - [-0.3, 0.4][joint]).abs() < 1e-15);
            for values in [&motion.q, &motion.dq, &motion.ddq] {
                for pair in values[range.clone()][2..].chunks(2) {
                    assert!((pair[0] - pair[1]).abs() < 2e-6);
                }
            }
            assert_eq!([motion.dq[range.start], motion.ddq[range.start]], [0.0, 0.0]);
        }
        let mut alone = Motion::default();
        let member = &family.members()[0];
        member.motion(&parameters[..member.parameters()], &[2.0], &mut alone);
        family.motion(&parameters, &[3.5], &mut motion);
        assert_eq!((motion.q[1], motion.dddq[1]), (alone.q[1], alone.dddq[1]));
    }

    #[test]
    fn rejects_inconsistent_members() {
        let make = |members, settings: &JoinedSettings| FamilySequence::new(members, settings);
        assert!(make(vec![], &JoinedSettings::default()).is_err());
        assert!(make(members(), &JoinedSettings { move_s: 0.0, ..Default::default() }).is_err());
        assert!(make(members(), &JoinedSettings { start: Some(vec![0.0]), ..Default::default() }).is_err());
        let mut mixed = members();
        mixed.push(Box::new(FrictionLadder::new(3, 20.0, &FrictionLadderSettings::default()).unwrap()));
        assert!(make(mixed, &JoinedSettings::default()).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn exact(seed in any::<u64>(), open in any::<bool>()) {
            let end = (!open).then(|| vec![0.2, -0.1]);
            let mut list = members();
            if let Some(member) = list.get_mut(1) {
                *member = Box::new(Fourier::new(2, 6.0, &FourierSettings::default()).unwrap());
            }
            let family = FamilySequence::new(list, &JoinedSettings { move_s: 6.0, start: end.clone(), end }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::rest(&family, seed);
        }

        /// Members in motion at their ends have a gradient through the moves too.
        #[test]
        fn gradient_through_moves_in_motion(seed in any::<u64>()) {
            let family = FamilySequence::new(members(), &JoinedSettings { move_s: 9.0, ..Default::default() }).unwrap();
            check::gradient_at(&family, &at(seed, &family), seed);
        }
    }
}
