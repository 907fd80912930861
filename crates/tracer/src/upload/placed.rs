//! A scene's geometry on the device: shapes, and where they are placed.

use std::sync::Arc;

use super::{SceneCache, UploadError, Uploader, cache::ShapesOnGpu, placement::Placement, tables::Tables};
use crate::{
    bvh::HierarchyKind,
    features::{Feature, SceneFeatures},
    kernels::KernelConstants,
    scene::Scene,
};

/// All that traversal needs but the instance table, which lights have a part in.
pub(super) struct Placed {
    pub shapes: Arc<ShapesOnGpu>,
    pub placement: Placement,
    /// The shapes', with the upper level.
    pub tables: Tables,
}

impl Placed {
    /// Builds and uploads what is not in `cache`.
    pub(super) fn upload(
        scene: &Scene,
        cache: &mut SceneCache,
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        let split = cache.split(scene);
        let shapes = cache.shapes(scene, &split, uploader)?;
        let placement = Placement::of(scene, &split, cache.hierarchy(), &shapes.shapes);
        let tables = shapes.tables.with_upper_level(shapes.shapes.node_count, &placement.nodes, uploader)?;
        Ok(Self { shapes, placement, tables })
    }

    /// What a kernel must contain for the geometry.
    pub(super) fn features(&self, hierarchy: HierarchyKind) -> SceneFeatures {
        SceneFeatures::default()
            .with(Feature::Instances, !self.placement.is_single_level)
            .with(Feature::GeometryTextures, matches!(self.tables, Tables::Textures(_)))
            .with(Feature::BinaryNodes, hierarchy == HierarchyKind::Binary)
    }

    /// Numbers of the kernels.
    pub(super) fn constants(&self, environment_cells: [u32; 2]) -> KernelConstants {
        KernelConstants { stack_size: self.placement.stack_size, environment_cells }
    }
}
