//! A session in a headset: events, frames and input.

use std::time::{Duration, Instant};

use glam::Quat;
use openxr as xr;
use tracer::gpu::Gpu;

use super::device;
use super::error::VrError;
use super::eyes::{self, Eye, EyePicture, EyeView, orientation};
use super::gaze::GazeSample;
use super::input::{Input, Press};
use super::lifecycle::{Deed, Ended, Lifecycle};
use super::runtime::{Facts, Runtime};

const STEREO: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;

/// A runtime, its headset, a graphics device and a session.
pub struct Headset {
    // In the order in which they must go.
    eyes: [Eye; 2],
    input: Input,
    local: xr::Space,
    head: xr::Space,
    stream: xr::FrameStream<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    session: xr::Session<xr::Vulkan>,
    gpu: Gpu,
    runtime: Runtime,
    format: wgpu::TextureFormat,
    blend_mode: xr::EnvironmentBlendMode,
    lifecycle: Lifecycle,
    /// Runtime's time of the frame that is being drawn or was drawn last.
    shown_at: Option<xr::Time>,
}

/// A frame that the runtime waits for. It must be given to [`Headset::submit`].
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Frame {
    /// When it will be seen, by the runtime's clock.
    pub shown_at: xr::Time,
    /// Time between frames.
    pub period: Duration,
    /// Whether anybody sees it.
    pub is_visible: bool,
    /// When the runtime asked for it.
    pub started: Instant,
    /// How many of the headset's frames went by without a picture from here since the last one.
    pub missed: u32,
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Submitted {
    /// Both eyes see it.
    Drawn,
    /// Nobody would have seen it, or the head's pose is not known.
    Skipped,
}

impl Headset {
    /// Finds the headset and opens a session. Pictures appear once [`Headset::poll`] has seen it begin.
    ///
    /// # Errors
    /// What is missing.
    pub fn enter() -> Result<Self, VrError> {
        let runtime = Runtime::find()?;
        let (instance, system) = (&runtime.instance, runtime.system);
        let sizes = instance
            .enumerate_view_configuration_views(system, STEREO)
            .map_err(VrError::call("xrEnumerateViewConfigurationViews"))?;
        let blend_modes = instance
            .enumerate_environment_blend_modes(system, STEREO)
            .map_err(VrError::call("xrEnumerateEnvironmentBlendModes"))?;
        let is_opaque = |mode: &xr::EnvironmentBlendMode| *mode == xr::EnvironmentBlendMode::OPAQUE;
        let device = device::open(&runtime)?;
        let (session, waiter, stream) = device::session(&runtime, &device)?;
        let gpu = device.gpu;
        let format = eyes::choose_format(&session)?;
        let eye = |index: usize| {
            let limit = gpu.device.limits().max_texture_dimension_2d;
            let size = sizes.get(index).map_or([1; 2], |view| {
                let side = |recommended: u32, most: u32| recommended.clamp(1, most.clamp(1, limit));
                [
                    side(view.recommended_image_rect_width, view.max_image_rect_width),
                    side(view.recommended_image_rect_height, view.max_image_rect_height),
                ]
            });
            Eye::new(&gpu, &session, format, size)
        };
        let eyes = [eye(0)?, eye(1)?];
        let space = |kind| {
            session.create_reference_space(kind, xr::Posef::IDENTITY).map_err(VrError::call("xrCreateReferenceSpace"))
        };
        let (local, head) = (space(xr::ReferenceSpaceType::LOCAL)?, space(xr::ReferenceSpaceType::VIEW)?);
        Ok(Self {
            eyes,
            input: Input::new(&runtime, &session)?,
            local,
            head,
            stream,
            waiter,
            session,
            gpu,
            format: format.1,
            // A see-through headset may have no opaque mode.
            blend_mode: blend_modes
                .iter()
                .copied()
                .find(is_opaque)
                .or(blend_modes.first().copied())
                .unwrap_or(xr::EnvironmentBlendMode::OPAQUE),
            runtime,
            lifecycle: Lifecycle::default(),
            shown_at: None,
        })
    }

    /// The headset's graphics device. Only the thread that drives this value may submit to it.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Runtime and headset.
    pub fn facts(&self) -> &Facts {
        self.runtime.facts()
    }

    /// Where the session is.
    pub fn lifecycle(&self) -> &Lifecycle {
        &self.lifecycle
    }

    /// Pixels of each eye's picture.
    pub fn eye_sizes(&self) -> [[u32; 2]; 2] {
        [self.eyes[0].size, self.eyes[1].size]
    }

    /// Takes in the runtime's events, and does what they ask for. What it returns is final.
    pub fn poll(&mut self) -> Option<Ended> {
        loop {
            let mut storage = xr::EventDataBuffer::new();
            let event = match self.runtime.instance.poll_event(&mut storage) {
                Ok(Some(event)) => event,
                Ok(None) => return None,
                Err(code) => return Some(Ended::Lost(VrError::call("xrPollEvent")(code))),
            };
            let deed = match event {
                xr::Event::SessionStateChanged(change) => self.lifecycle.change(change.state()),
                xr::Event::InstanceLossPending(_) => Some(Deed::Lose),
                _ => None,
            };
            let done = match deed {
                None => Ok(()),
                Some(Deed::Begin) => self.session.begin(STEREO).map(drop).map_err(VrError::call("xrBeginSession")),
                Some(Deed::End) => self.session.end().map(drop).map_err(VrError::call("xrEndSession")),
                Some(Deed::Leave) => return Some(Ended::Asked),
                Some(Deed::Lose) => return Some(Ended::announced()),
            };
            if let Err(error) = done {
                return Some(Ended::Lost(error));
            }
        }
    }

    /// Asks the runtime to end the session; [`Headset::poll`] says when it has.
    ///
    /// # Errors
    /// When the session does not run, and can be dropped at once.
    pub fn request_exit(&self) -> Result<(), VrError> {
        self.session.request_exit().map_err(VrError::call("xrRequestExitSession"))
    }

    /// Waits until the runtime wants a frame, and begins it. Only while [`Lifecycle::is_running`].
    ///
    /// # Errors
    /// When the runtime is gone.
    pub fn begin_frame(&mut self) -> Result<Frame, VrError> {
        let state = self.waiter.wait().map_err(VrError::call("xrWaitFrame"))?;
        let started = Instant::now();
        self.stream.begin().map_err(VrError::call("xrBeginFrame"))?;
        let (shown_at, period) = (state.predicted_display_time, state.predicted_display_period);
        let last = self.shown_at.replace(shown_at);
        let missed = last.map_or(0, |last| frames_between(last, shown_at, period).saturating_sub(1));
        let period = Duration::from_nanos(period.as_nanos().max(0) as u64);
        Ok(Frame { shown_at, period, is_visible: state.should_render, started, missed })
    }

    /// Draws both eyes at the head's latest pose and hands the frame over. `draw` records and submits.
    ///
    /// # Errors
    /// When the runtime is gone, or `draw` fails; the frame is handed over empty then.
    pub fn submit<E: From<VrError>>(
        &mut self,
        frame: Frame,
        draw: impl FnOnce(&[EyePicture<'_>; 2]) -> Result<(), E>,
    ) -> Result<Submitted, E> {
        let drawn = if frame.is_visible { self.draw(frame.shown_at, draw) } else { Ok(None) };
        let views = drawn.as_ref().ok().and_then(Option::as_ref);
        let layer_views = views.map(|views| {
            [0, 1].map(|eye| {
                let image = xr::SwapchainSubImage::new()
                    .swapchain(&self.eyes[eye].swapchain)
                    .image_rect(self.eyes[eye].rect())
                    .image_array_index(0);
                xr::CompositionLayerProjectionView::new().pose(views[eye].pose).fov(views[eye].fov).sub_image(image)
            })
        });
        let layer =
            layer_views.as_ref().map(|views| xr::CompositionLayerProjection::new().space(&self.local).views(views));
        let layers: Vec<&xr::CompositionLayerBase<'_, xr::Vulkan>> = layer.iter().map(|layer| &**layer).collect();
        let ended = self.stream.end(frame.shown_at, self.blend_mode, &layers);
        let drawn = drawn?;
        ended.map_err(VrError::call("xrEndFrame"))?;
        Ok(if drawn.is_some() { Submitted::Drawn } else { Submitted::Skipped })
    }

    fn draw<E: From<VrError>>(
        &mut self,
        shown_at: xr::Time,
        draw: impl FnOnce(&[EyePicture<'_>; 2]) -> Result<(), E>,
    ) -> Result<Option<[xr::View; 2]>, E> {
        let images = [self.eyes[0].acquire()?, self.eyes[1].acquire()?];
        // As late as can be: the newest pose is the best guess of where the head will be.
        let located = self.session.locate_views(STEREO, shown_at, &self.local);
        let views = match located {
            Ok((flags, views)) if flags.contains(xr::ViewStateFlags::ORIENTATION_VALID) => views,
            Ok(_) => Vec::new(),
            Err(code) => return Err(VrError::call("xrLocateViews")(code).into()),
        };
        let picture = |eye: usize| {
            let view = EyeView::new(views.get(eye)?)?;
            let target = self.eyes[eye].image(images[eye])?;
            Some(EyePicture { view, target, format: self.format, size: self.eyes[eye].size })
        };
        let drawn = match (picture(0), picture(1)) {
            (Some(left), Some(right)) => draw(&[left, right]).map(|()| Some([views[0], views[1]])),
            _ => Ok(None),
        };
        for eye in &mut self.eyes {
            eye.release()?;
        }
        drawn
    }

    /// The head's orientation in LOCAL space when the last frame is seen; `None` when it is not known.
    ///
    /// # Errors
    /// When the runtime is gone.
    pub fn head(&self) -> Result<Option<Quat>, VrError> {
        let Some(time) = self.shown_at else { return Ok(None) };
        let location = self.head.locate(&self.local, time).map_err(VrError::call("xrLocateSpace"))?;
        let valid = location.location_flags.contains(xr::SpaceLocationFlags::ORIENTATION_VALID);
        Ok(valid.then_some(location.pose.orientation).and_then(orientation))
    }

    /// What was pressed since the last call, and the newest sample of the eyes. Only while [`Lifecycle::is_focused`].
    ///
    /// # Errors
    /// When the runtime is gone.
    pub fn input(&mut self) -> Result<(Vec<Press>, Option<GazeSample>), VrError> {
        Ok((self.input.sync(&self.session)?, self.gaze()?))
    }

    /// The newest sample of the eyes; `None` without an eye tracker.
    ///
    /// # Errors
    /// When the runtime is gone.
    pub fn gaze(&self) -> Result<Option<GazeSample>, VrError> {
        if !self.facts().eye_gaze {
            return Ok(None);
        }
        let arrived = Instant::now();
        let clock = self.runtime.now();
        let Some(time) = clock.or(self.shown_at) else { return Ok(None) };
        let reading = self.input.gaze(&self.runtime, &self.session, &self.local, time)?;
        let captured = reading.and_then(|reading| reading.sampled).zip(clock).and_then(|(sampled, now)| {
            let age = now.as_nanos().checked_sub(sampled.as_nanos())?;
            arrived.checked_sub(Duration::from_nanos(age.max(0) as u64))
        });
        Ok(Some(GazeSample {
            captured: captured.unwrap_or(arrived),
            arrived,
            time_known: captured.is_some(),
            local_from_gaze: reading.map(|reading| reading.local_from_gaze),
        }))
    }
}

impl Drop for Headset {
    fn drop(&mut self) {
        // What still draws into the runtime's images must be done before they go. A lost device draws nothing.
        let _ = self.gpu.wait();
    }
}

/// Frames from one display time to another, at least 0.
fn frames_between(from: xr::Time, to: xr::Time, period: xr::Duration) -> u32 {
    let period = period.as_nanos();
    if period <= 0 {
        return 1;
    }
    let frames = (to.as_nanos().saturating_sub(from.as_nanos()) as f64 / period as f64).round();
    // The cast saturates.
    frames.max(0.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missed_frames_are_counted_by_display_times() {
        let between = |ns: i64| {
            frames_between(xr::Time::from_nanos(1_000), xr::Time::from_nanos(1_000 + ns), xr::Duration::from_nanos(100))
        };
        assert_eq!([between(0), between(96), between(104), between(290), between(-50)], [0, 1, 1, 3, 0]);
        assert_eq!(frames_between(xr::Time::from_nanos(5), xr::Time::from_nanos(9), xr::Duration::from_nanos(0)), 1);
    }
}
