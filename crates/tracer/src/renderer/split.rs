//! How light samples are shared between the environment and the lights: by what of each reaches the surfaces that are seen.
//! The share is a property of the scene and of the film that it was set for, so that films do not depend on where the viewer went first.

use glam::{Mat3, Quat, Vec3};

use super::{FilmPose, RenderError, Renderer, schedule::PathBatch};
use crate::{
    distribution::{Distribution, FilmFrame},
    film::read_ranges,
    kernels::layout::{self, BatchParams, SampleRecord},
    scene::Scene,
};

/// Samples of each pilot run.
const PILOT_SAMPLES: u32 = 1 << 10;
/// Viewpoints that are asked at most.
const MOST_VIEWPOINTS: usize = 4;
/// Neither kind of light gets less than this share: the pilot may have missed it.
const LEAST_SHARE: f32 = 0.1;
/// A pilot sample counts at most this many times the mean: one bright path must not decide.
const LARGEST_OVER_MEAN: f64 = 50.0;

impl Renderer {
    /// Sets the probability of sampling the environment where there are lights too.
    pub(super) fn split_light_samples(&mut self, scene: &Scene) -> Result<(), RenderError> {
        let has_both = self.scene.as_ref().is_some_and(|s| s.environment_probability > 0.0 && s.light_count > 0);
        if !has_both {
            return Ok(());
        }
        let (mut environment, mut lights) = (0.0, 0.0);
        for pose in viewpoints(scene) {
            // What one bounce adds to what is seen directly, with both and with the lights alone; the numbers are common.
            let both = self.pilot(pose, 1, 1.0)? - self.pilot(pose, 0, 1.0)?;
            let of_lights = self.pilot(pose, 1, 0.0)? - self.pilot(pose, 0, 0.0)?;
            lights += of_lights.max(0.0);
            environment += (both - of_lights).max(0.0);
        }
        if let Some(on_gpu) = &mut self.scene
            && environment + lights > 0.0
        {
            let share = (environment / (environment + lights)) as f32;
            on_gpu.environment_probability = share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        }
        Ok(())
    }

    /// Mean luminance over the film with this many bounces and the environment's radiance times a factor.
    fn pilot(&self, pose: FilmPose, max_bounces: u32, environment: f32) -> Result<f64, RenderError> {
        let everywhere = Distribution::omnidirectional(self.distribution.inverse().clone());
        let film = FilmFrame { options: &self.options.film, world_from_film: pose.world_from_film };
        let encoded = everywhere.encode(film, false, None);
        let next = self.batch_params(PILOT_SAMPLES)?;
        let params = BatchParams {
            first_index_low: 0,
            first_index_high: 0,
            seed: 0,
            use_sobol: 1,
            stratum_bits: everywhere.stratum_bits(&self.options.film),
            max_bounces,
            camera_position: pose.position.to_array(),
            world_from_film: layout::columns(Mat3::from_quat(pose.world_from_film)),
            environment_radiance: next.environment_radiance.map(|c| c * environment),
            // What is lit does not depend on what stands behind it.
            has_backdrop: 0,
            layers: encoded.layers,
            layer_count: encoded.layer_count,
            fovea_end: 0,
            ..next
        };
        self.gpu.queue.write_buffer(&self.params[0], 0, bytemuck::bytes_of(&params));
        self.submit_paths(PathBatch { samples: PILOT_SAMPLES, max_bounces })?;
        let bytes = u64::from(PILOT_SAMPLES) * size_of::<SampleRecord>() as u64;
        let records: Vec<SampleRecord> = read_ranges(&self.gpu, &[(&self.records, 0, bytes)])?;
        let luminance = |r: &SampleRecord| f64::from(Vec3::from(r.radiance).dot(Vec3::new(0.2126, 0.7152, 0.0722)));
        let values: Vec<f64> = records.iter().map(luminance).filter(|l| l.is_finite()).collect();
        let mean =
            |values: &[f64], most: f64| values.iter().map(|l| l.min(most)).sum::<f64>() / f64::from(PILOT_SAMPLES);
        Ok(mean(&values, LARGEST_OVER_MEAN * mean(&values, f64::INFINITY)))
    }
}

/// The scene's first cameras, or its centre.
fn viewpoints(scene: &Scene) -> Vec<FilmPose> {
    let cameras = scene.cameras.iter().take(MOST_VIEWPOINTS);
    let mut poses: Vec<FilmPose> =
        cameras.map(|camera| FilmPose { position: camera.position, world_from_film: camera.rotation }).collect();
    if poses.is_empty() {
        let (low, high) = scene.bounds().unwrap_or((Vec3::ZERO, Vec3::ZERO));
        poses.push(FilmPose { position: 0.5 * (low + high), world_from_film: Quat::IDENTITY });
    }
    poses
}
