//! Where somebody in the headset looks: the eyes, the pointer over the mirror, or the head.
//!
//! The eyes' directions are filtered in degrees about an anchor that stands still in the panorama, so that a head that
//! turns about a fixed gaze is no movement of the gaze, and there is no pole or seam near it.

use std::fmt;
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};

use crate::gaze::filter::{FilterSettings, Filtered, GazeFilter, LOST_SECS, Phase};
use crate::view::{direction, yaw_pitch};

/// A gaze farther than this from the anchor moves the anchor, radians.
const REACH: f32 = 0.8;

/// One answer of the runtime to where the eyes look.
#[derive(Clone, Copy, Debug)]
pub struct GazeSample {
    /// When the eyes were there; when the answer came, where the runtime does not know.
    pub captured: Instant,
    /// When the answer came.
    pub arrived: Instant,
    /// Whether the runtime knew the time.
    pub time_known: bool,
    /// LOCAL from gaze, which looks along -Z; `None` while the eyes are closed or not tracked.
    pub local_from_gaze: Option<Quat>,
}

/// What the fovea goes by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GazeFrom {
    /// The headset's eye tracker.
    Eyes,
    /// The pointer over the mirror in the desktop window.
    Pointer,
    /// Straight ahead.
    #[default]
    Head,
}

impl fmt::Display for GazeFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Eyes => "the headset's eye tracker",
            Self::Pointer => "the pointer over the mirror",
            Self::Head => "the head's direction",
        })
    }
}

/// Filtered gaze of the eyes, in film space.
#[derive(Clone, Debug)]
pub struct EyeGaze {
    filter: GazeFilter,
    epoch: Instant,
    film_from_anchor: Quat,
    last: Option<Instant>,
    /// When the last answer came that was newer than the one before.
    heard: Instant,
    live: Option<Live>,
}

#[derive(Clone, Copy, Debug)]
struct Live {
    direction: Vec3,
    phase: Phase,
    /// Of the sample that the direction comes from.
    captured: Instant,
    time_known: bool,
}

impl EyeGaze {
    /// Nothing is known at first.
    pub fn new(now: Instant) -> Self {
        Self {
            filter: GazeFilter::new(FilterSettings::default()),
            epoch: now,
            film_from_anchor: Quat::IDENTITY,
            last: None,
            heard: now,
            live: None,
        }
    }

    /// Takes in an answer. One that is not newer than the last, as when a frame asks twice for one sample, is passed over.
    pub fn take(&mut self, sample: GazeSample, film_from_local: Quat) {
        if self.last.is_some_and(|last| sample.captured <= last) {
            return;
        }
        (self.last, self.heard) = (Some(sample.captured), sample.arrived);
        let looked = sample.local_from_gaze.map(|gaze| film_from_local * gaze * Vec3::NEG_Z);
        if let Some(looked) = looked
            && looked.dot(self.film_from_anchor * Vec3::NEG_Z) < REACH.cos()
        {
            // To the filter that is a jump, and it starts anew there.
            self.film_from_anchor = Quat::from_rotation_arc(Vec3::NEG_Z, looked.normalize());
        }
        let point = looked.map(|looked| {
            let (yaw, pitch) = yaw_pitch(self.film_from_anchor.inverse() * looked);
            [yaw, pitch].map(|angle| f64::from(angle.to_degrees()))
        });
        let time_secs = sample.captured.saturating_duration_since(self.epoch).as_secs_f64();
        let Some(Filtered { point_deg, phase, .. }) = self.filter.update(time_secs, point) else { return };
        let [yaw, pitch] = point_deg.map(|angle| (angle as f32).to_radians());
        // A closed eye has no newer sample, also in the moments before that counts as a blink.
        let moves = looked.is_some() && matches!(phase, Phase::Fixation | Phase::Saccade);
        let captured = match &self.live {
            Some(live) if !moves => live.captured,
            _ => sample.captured,
        };
        let direction = self.film_from_anchor * direction(yaw, pitch);
        self.live = Some(Live { direction, phase, captured, time_known: sample.time_known });
    }

    /// Where the eyes look, in film space; `None` before the first sample and when they are lost, which they also are when no
    /// answers come any more: a session that is not focused gets none.
    pub fn direction(&self, now: Instant) -> Option<Vec3> {
        let is_heard = now.saturating_duration_since(self.heard).as_secs_f64() <= LOST_SECS;
        self.live.filter(|live| is_heard && live.phase != Phase::Lost).map(|live| live.direction)
    }

    /// Age of the sample behind the direction; `None` where the runtime does not tell when it was taken.
    pub fn age(&self, now: Instant) -> Option<Duration> {
        self.live.filter(|live| live.time_known).map(|live| now.saturating_duration_since(live.captured))
    }

    /// What the eyes do.
    pub fn phase(&self) -> Option<Phase> {
        self.live.map(|live| live.phase)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn sample(at: Instant, towards: Option<Vec3>) -> GazeSample {
        let local_from_gaze = towards.map(|towards| Quat::from_rotation_arc(Vec3::NEG_Z, towards));
        GazeSample { captured: at, arrived: at, time_known: true, local_from_gaze }
    }

    fn ms(value: u64) -> Duration {
        Duration::from_millis(value)
    }

    #[test]
    fn a_fixation_is_found_wherever_it_is() {
        // Straight up is the pole, behind is the panorama's seam.
        for towards in [Vec3::NEG_Z, Vec3::Y, Vec3::Z, -Vec3::Y, Vec3::new(0.6, -0.3, 0.7).normalize()] {
            let start = Instant::now();
            let mut gaze = EyeGaze::new(start);
            let film_from_local = Quat::from_rotation_y(0.7);
            for step in 1..60 {
                // A tenth of a degree of noise that is the same to all sides.
                let wobble =
                    Quat::from_axis_angle(towards.any_orthonormal_vector(), 0.0017 * (step as f32 * 2.4).sin());
                gaze.take(sample(start + ms(step * 8), Some(wobble * towards)), film_from_local);
            }
            let off = gaze.direction(start + ms(480)).unwrap().angle_between(film_from_local * towards).to_degrees();
            assert!(off < 0.1, "{towards}: {off} degrees");
        }
    }

    #[test]
    fn a_saccade_is_followed_at_once_and_a_blink_holds_the_place() {
        let start = Instant::now();
        let mut gaze = EyeGaze::new(start);
        let (from, to) = (direction(0.0, 0.0), direction(0.2, 0.1));
        let mut now = start;
        let mut feed = |gaze: &mut EyeGaze, towards, count: u64| {
            for _ in 0..count {
                now += ms(8);
                gaze.take(sample(now, towards), Quat::IDENTITY);
            }
            now
        };
        feed(&mut gaze, Some(from), 40);
        let landed = feed(&mut gaze, Some(to), 1);
        assert!(gaze.direction(landed).unwrap().angle_between(to) < 1e-3, "with the first sample after it");
        let seen = feed(&mut gaze, Some(to), 40);
        let closed = feed(&mut gaze, None, 30);
        assert_eq!(gaze.phase(), Some(Phase::Blink));
        assert!(gaze.direction(closed).unwrap().angle_between(to) < 1e-3, "the place is held");
        assert_eq!(gaze.age(closed), Some(closed - seen), "it is as old as the last sight of the eye");
        let lost = feed(&mut gaze, None, 60);
        assert_eq!(gaze.direction(lost), None, "after half a second the eyes are lost");
    }

    #[test]
    fn eyes_that_nothing_is_heard_of_are_lost_until_they_are_heard_of_again() {
        let start = Instant::now();
        let mut gaze = EyeGaze::new(start);
        (1..40).for_each(|step| gaze.take(sample(start + ms(8 * step), Some(Vec3::NEG_Z)), Quat::IDENTITY));
        let last = start + ms(8 * 39);
        assert!(gaze.direction(last + ms(400)).is_some(), "as in a blink");
        // A runtime that says the same again has nothing new to say.
        gaze.take(GazeSample { arrived: last + ms(590), ..sample(last, Some(Vec3::NEG_Z)) }, Quat::IDENTITY);
        assert_eq!(gaze.direction(last + ms(600)), None);
        let back = last + ms(5000);
        (1..20).for_each(|step| gaze.take(sample(back + ms(8 * step), Some(Vec3::X)), Quat::IDENTITY));
        assert!(gaze.direction(back + ms(160)).unwrap().angle_between(Vec3::X) < 1e-3);
    }

    #[test]
    fn a_sample_that_is_asked_for_twice_counts_once() {
        let start = Instant::now();
        let mut gaze = EyeGaze::new(start);
        gaze.take(sample(start + ms(8), Some(Vec3::NEG_Z)), Quat::IDENTITY);
        gaze.take(sample(start + ms(8), Some(Vec3::X)), Quat::IDENTITY);
        assert!(gaze.direction(start + ms(8)).unwrap().distance(Vec3::NEG_Z) < 1e-6);
    }
}
