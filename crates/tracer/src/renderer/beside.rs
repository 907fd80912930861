//! Two films of one scene on one device: the scene and its kernels are there once.

use std::sync::Arc;

use super::{RenderError, Renderer};
use crate::distribution::Distribution;

impl Renderer {
    /// A renderer of the same scene from the same place, with the same options, shaders and smoothing, adaptive if this one is, and with a
    /// film and a distribution of its own.
    /// Buffers and textures of the scene, and compiled kernels, are shared.
    ///
    /// # Errors
    /// When the second film does not fit the device or a kernel does not compile.
    pub fn beside(&self, distribution: Distribution) -> Result<Self, RenderError> {
        let mut other = Self::new(&self.gpu, &self.options, distribution)?;
        other.pose = self.pose;
        (other.schedule, other.path_buffers) = (self.schedule, self.path_buffers.clone());
        (other.technique, other.spare_features) = (self.technique, self.spare_features);
        (other.sources, other.first_sample) = (Arc::clone(&self.sources), self.first_sample);
        other.view.smoothing_samples = self.view.smoothing_samples;
        other.set_adaptive(self.is_adaptive());
        other.share_scene_of(self)?;
        Ok(other)
    }

    /// Goes on with the scene of another renderer on the same device, from an empty film. Nothing is uploaded.
    ///
    /// # Errors
    /// When a kernel does not compile.
    pub fn share_scene_of(&mut self, other: &Self) -> Result<(), RenderError> {
        self.scene.clone_from(&other.scene);
        self.scene_hash = other.scene_hash;
        self.scene_version += 1;
        self.pipelines.clone_from(&other.pipelines);
        if self.scene.is_some() {
            self.bind()?;
            self.warm_up()?;
        }
        self.restart();
        Ok(())
    }

    /// Starts the film anew; nothing of the old picture is shown.
    pub fn restart_clean(&mut self) {
        self.view.forget();
        self.restart();
    }
}
