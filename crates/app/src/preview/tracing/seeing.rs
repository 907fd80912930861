//! What is known about the picture beside its colours: first hits, the histogram, and what colours stand for.

use std::time::{Duration, Instant};

use tracer::view::ViewSettings;

use super::super::controls::Controls;
use super::super::engine::Look;
use super::super::seeing::Seen;
use super::{Tracing, view_settings};
use crate::readback::FIRST_HITS_AT_ONCE;

/// First hits take at most about this long of one picture; the next one goes on.
const FIRST_HITS_TIME: Duration = Duration::from_millis(200);
/// Guides are looked for at most this long between two batches, ...
const GUIDES_TIME: Duration = Duration::from_millis(60);
/// ... and this long where nothing is traced.
const GUIDES_TIME_PAUSED: Duration = Duration::from_millis(200);
/// How often pixels are counted while only samples change.
const COUNT_INTERVAL: Duration = Duration::from_millis(400);

/// What was seen in the last picture.
#[derive(Debug, Default)]
pub(super) struct Seeing {
    seen: Seen,
    /// The picture's first hits are not all known.
    is_unfinished: bool,
    /// When pixels were last counted, and how the picture was shown then.
    counted: Option<(Instant, Controls)>,
}

impl Tracing {
    /// What is known about the picture as it was last shown.
    pub fn seen(&self) -> Seen {
        Seen { beside: self.beside_readout(), ..self.seeing.seen }
    }

    /// Whether the last picture shows less than it could, so that the next one is due before samples are.
    pub fn is_unfinished(&self) -> bool {
        self.seeing.is_unfinished
    }

    /// Finds what a view of first hits shows, as far as time allows.
    pub(super) fn find_first_hits(&mut self, settings: &ViewSettings) -> anyhow::Result<()> {
        self.seeing.is_unfinished = settings.debug_view.shows_first_hits();
        let start = Instant::now();
        while self.seeing.is_unfinished && start.elapsed() < FIRST_HITS_TIME {
            self.seeing.is_unfinished = !self.renderer()?.trace_first_hits(settings, FIRST_HITS_AT_ONCE)?;
        }
        Ok(())
    }

    /// Whether a picture that is drawn in full is denoised by now; `None` where it is not to be.
    pub fn is_guided(&self, look: &Look) -> Option<bool> {
        let settings = view_settings(look, self.picture_size(look, 1));
        let renderer = self.open.as_ref()?.renderer.as_ref()?;
        let is_wanted = settings.uses_guides() && renderer.wants_first_hits(&settings);
        is_wanted.then(|| renderer.knows_first_hits(&settings))
    }

    /// Goes on with finding what guides the picture, for a short time.
    pub fn find_guides(&mut self, look: &Look) -> anyhow::Result<()> {
        let settings = view_settings(look, self.picture_size(look, 1));
        let most = if look.controls.paused { GUIDES_TIME_PAUSED } else { GUIDES_TIME };
        let start = Instant::now();
        while self.is_guided(look) == Some(false) && start.elapsed() < most {
            self.renderer()?.trace_first_hits(&settings, FIRST_HITS_AT_ONCE)?;
        }
        Ok(())
    }

    /// Takes in what the picture that was just drawn says.
    pub(super) fn look_at_picture(&mut self, look: &Look, settings: &ViewSettings) -> anyhow::Result<()> {
        self.seeing.seen.scale = self.renderer()?.debug_scale(settings.debug_view);
        if !look.controls.histogram {
            (self.seeing.seen.histogram, self.seeing.counted) = (None, None);
            return Ok(());
        }
        let now = Instant::now();
        // A picture that stands still is the last for a while.
        let is_due =
            look.controls.paused
                || self.seeing.counted.as_ref().is_none_or(|(at, controls)| {
                    now.duration_since(*at) >= COUNT_INTERVAL || *controls != look.controls
                });
        if is_due {
            self.seeing.seen.histogram = Some(self.renderer()?.histogram(settings)?);
            self.seeing.counted = Some((now, look.controls.clone()));
        }
        Ok(())
    }
}
