//! A simulated observer: from samples to the split times of the method's authors, and what they published.
//!
//! The observer looks at the gaze in a picture that is refreshed ten times a second, is sure when two pictures in a row pass
//! the threshold, and answers. Published: Koskela et al. 2017, Table 1.

/// Seconds between two pictures.
const REFRESH_SECS: f64 = 0.1;
/// Seconds from seeing to answering: a simple choice takes people 0.4 to 0.5 s.
const RESPONSE_SECS: f64 = 0.45;

/// What the observer is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// The outline of what is looked at.
    Outline,
    /// Its material.
    Material,
}

impl Split {
    /// In the order of the paper's table.
    pub const ALL: [Self; 2] = [Self::Outline, Self::Material];

    /// In tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Outline => "outline",
            Self::Material => "material",
        }
    }

    /// The column that decides.
    pub fn measure(self) -> &'static str {
        match self {
            Self::Outline => "outline",
            Self::Material => "colour",
        }
    }

    /// The measure's value that suffices. Outline: half of the energy of the picture's gradients is the scene's. Material: a
    /// mean colour difference of 5, about twice the just noticeable 2.3.
    pub fn threshold(self) -> f64 {
        match self {
            Self::Outline => std::f64::consts::FRAC_1_SQRT_2,
            Self::Material => 5.0,
        }
    }

    /// The measure as what falls as one over the samples: noise over signal in the gradients, the squared difference.
    pub fn square(self, value: f64) -> f64 {
        match self {
            Self::Outline => value.max(0.02).powi(-2) - 1.0,
            Self::Material => value * value,
        }
    }
}

/// The observer's split time when the threshold is passed after `reached_secs`.
pub fn split_secs(reached_secs: f64) -> f64 {
    ((reached_secs / REFRESH_SECS).ceil() + 1.0) * REFRESH_SECS + RESPONSE_SECS
}

/// One row of the authors' table for one question.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Scene.
    pub scene: &'static str,
    /// Question.
    pub split: Split,
    /// Mean split time of OD, seconds.
    pub od_secs: f64,
    /// Split times of VP and FV in percent of OD's.
    pub vp_percent: f64,
    /// See above.
    pub fv_percent: f64,
}

const fn row(scene: &'static str, split: Split, [od_secs, vp_percent, fv_percent]: [f64; 3]) -> Published {
    Published { scene, split, od_secs, vp_percent, fv_percent }
}

/// The authors' table.
pub const PUBLISHED: [Published; 10] = [
    row("bmw", Split::Outline, [6.1, 41.8, 20.8]),
    row("classroom", Split::Outline, [15.6, 27.1, 11.6]),
    row("conference", Split::Outline, [41.9, 29.7, 7.6]),
    row("sibenik", Split::Outline, [24.7, 29.5, 11.4]),
    row("sponza", Split::Outline, [16.1, 25.9, 9.1]),
    row("bmw", Split::Material, [29.9, 33.6, 11.8]),
    row("classroom", Split::Material, [67.9, 30.8, 7.9]),
    row("conference", Split::Material, [137.2, 33.9, 8.2]),
    row("sibenik", Split::Material, [76.7, 34.3, 10.9]),
    row("sponza", Split::Material, [60.4, 30.1, 7.5]),
];

impl Published {
    /// Seconds that do not depend on the mode, if rendering alone were `ratio` times sooner in FV than in OD:
    /// OD = s + T and FV = s + T / ratio.
    pub fn fixed_secs(&self, ratio: f64) -> f64 {
        (self.fv_percent / 100.0 * ratio - 1.0) * self.od_secs / (ratio - 1.0)
    }

    /// VP's split time in percent of OD's that this fixed part leads to, if VP's rendering is `vp_ratio` times sooner.
    pub fn predicted_vp_percent(&self, fv_ratio: f64, vp_ratio: f64) -> f64 {
        let fixed = self.fixed_secs(fv_ratio);
        (fixed + (self.od_secs - fixed) / vp_ratio) / self.od_secs * 100.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn split_times_are_whole_pictures_and_an_answer() {
        assert!((split_secs(0.0) - 0.55).abs() < 1e-12);
        assert!((split_secs(0.31) - (0.4 + 0.1 + 0.45)).abs() < 1e-12);
        assert!(split_secs(30.0) / 30.0 < 1.02);
    }

    #[test]
    fn thresholds_square_to_one_over_the_samples() {
        assert!((Split::Outline.square(Split::Outline.threshold()) - 1.0).abs() < 1e-12);
        assert!(Split::Outline.square(-0.5).is_finite());
        assert!((Split::Material.square(10.0) / Split::Material.square(5.0) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn the_fixed_part_gives_the_published_ratio_back() {
        for published in PUBLISHED {
            let fixed = published.fixed_secs(60.5);
            let rendering = published.od_secs - fixed;
            let percent = (fixed + rendering / 60.5) / published.od_secs * 100.0;
            assert!((percent - published.fv_percent).abs() < 1e-9);
            assert!((28.8..50.0).contains(&published.predicted_vp_percent(60.5, 3.47)));
            assert!((0.5..12.0).contains(&fixed), "{}: {fixed}", published.scene);
        }
    }
}
