//! Compiles what an object's first move needs before anybody moves one.
//!
//! A scene that nothing has been moved in has one level; the first move needs kernels with two, which a driver may compile for
//! seconds. Some compile at the first dispatch, and hold up the device's queue meanwhile. A rehearsal makes that move with a copy of
//! the scene on a device of its own, in a thread of its caller's: what the driver keeps of it is there when the move comes. The
//! renderer gets pipelines on its own device.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use super::{RenderError, Renderer, RendererOptions, Schedule};
use crate::{
    distribution::Distribution,
    features::Feature,
    film::FilmOptions,
    gpu::{Gpu, GpuError},
    kernels::{
        Kernel, KernelKey,
        pipelines::{KernelError, Pipeline},
    },
    scene::Scene,
};

/// Bytes of the largest scene that is rehearsed: it is on the device twice meanwhile.
const MOST_BYTES: u64 = 1 << 30;

/// A move that is to be rehearsed.
#[derive(Debug)]
pub struct Rehearsal {
    gpu: Gpu,
    options: RendererOptions,
    distribution: Distribution,
    schedule: Schedule,
    scene: Arc<Scene>,
    /// Of the scene, which moves.
    instance: usize,
}

/// The kernels of a first move, compiled.
#[derive(Debug)]
pub struct Rehearsed(Vec<(KernelKey, Arc<Pipeline>)>);

impl Rehearsed {
    /// What they are.
    pub fn keys(&self) -> impl Iterator<Item = &KernelKey> {
        self.0.iter().map(|(key, _)| key)
    }
}

/// Why a move could not be rehearsed.
#[derive(Debug, thiserror::Error)]
pub enum RehearsalError {
    /// There is no second device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// It cannot render the scene.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A kernel does not compile on the renderer's own device.
    #[error(transparent)]
    Kernel(#[from] KernelError),
}

impl Renderer {
    /// The first move of an object of the present scene, which is `scene`. `None` where the kernels have two levels already, the
    /// scene is too large to be there twice, or nothing in it can be moved.
    pub fn rehearsal(&self, scene: &Arc<Scene>) -> Option<Rehearsal> {
        if self.key(Kernel::Trace).features.contains(Feature::Instances) {
            return None;
        }
        let bytes = self.scene.as_ref()?.report.device_bytes;
        if bytes > MOST_BYTES || self.gpu.lacks_memory(bytes) {
            return None;
        }
        let film = FilmOptions { width: 8, height: 4, ..self.options.film };
        Some(Rehearsal {
            gpu: self.gpu.clone(),
            options: RendererOptions { film, ..self.options },
            distribution: self.distribution.clone(),
            schedule: self.schedule,
            instance: smallest(scene)?,
            scene: scene.clone(),
        })
    }

    /// Keeps kernels for the move that comes.
    pub fn take_in(&mut self, rehearsed: Rehearsed) {
        for (key, pipeline) in rehearsed.0 {
            self.pipelines.take_in(key, pipeline);
        }
    }
}

/// The visible instance with the fewest triangles.
fn smallest(scene: &Scene) -> Option<usize> {
    let visible = (0..scene.instances.len()).filter(|&index| scene.instances[index].visible);
    visible.min_by_key(|&index| scene.meshes[scene.instances[index].mesh as usize].triangles.len())
}

impl Rehearsal {
    /// Makes the move. Returns the kernels that it took, for the renderer to [take in](Renderer::take_in), or `None` if it was told to
    /// stop before.
    ///
    /// # Errors
    /// When there is no second device, or the scene does not fit it or its kernels do not compile.
    pub fn run(&self, should_stop: &AtomicBool) -> Result<Option<Rehearsed>, RehearsalError> {
        let gpu = self.gpu.another()?;
        let mut renderer = Renderer::new(&gpu, &self.options, self.distribution.clone())?;
        renderer.set_schedule(self.schedule)?;
        renderer.set_scene(&self.scene)?;
        if should_stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let mut moved = (*self.scene).clone();
        moved.instances[self.instance].world_from_mesh.translation.x += 1e-3;
        renderer.set_scene(&moved)?;
        let compiled = self.schedule.kernels().iter().map(|&kernel| {
            let key = renderer.key(kernel);
            let pipeline = Arc::new(Pipeline::create(&self.gpu.device, &key, None)?);
            Ok((key, pipeline))
        });
        Ok(Some(Rehearsed(compiled.collect::<Result<_, KernelError>>()?)))
    }
}
