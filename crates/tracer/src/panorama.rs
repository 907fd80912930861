//! The film as a picture that any number of views can be drawn from at once: for headsets, whose frames cannot wait.
//!
//! A [`Panorama`] is the film's panorama with holes filled, as a texture with coarser levels. It is anchored in the film,
//! so that nothing in it moves when the head does; [`Renderer::refresh_panorama`] brings it up to date a few rows at a
//! time, and [`Renderer::draw_eye`] draws what an eye sees of it, at a cost that does not depend on the film.
//!
//! [`Renderer::refresh_panorama`]: crate::renderer::Renderer::refresh_panorama
//! [`Renderer::draw_eye`]: crate::renderer::Renderer::draw_eye

use glam::{Quat, Vec3};

use crate::{
    film::{FilmMapping, FilmOptions},
    gpu::Gpu,
    view::ToneMap,
};

/// Texels of all levels: half floats, which every adapter filters.
pub(crate) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Texels of one step of a refresh, at most: what a frame can always afford.
const STEP_TEXELS: u32 = 1 << 16;

/// Tangents of the angles to the edges of a picture, from straight ahead; left and down are negative where the picture
/// reaches that far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    /// Left edge.
    pub left: f32,
    /// Right edge, greater than the left one.
    pub right: f32,
    /// Lower edge.
    pub down: f32,
    /// Upper edge, greater than the lower one.
    pub up: f32,
}

impl Frustum {
    /// As far to the left as to the right, and as far down as up.
    pub const fn symmetric(half_width: f32, half_height: f32) -> Self {
        Self { left: -half_width, right: half_width, down: -half_height, up: half_height }
    }
}

/// What an eye sees, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeSettings {
    /// World from eye, which looks along -Z.
    pub world_from_eye: Quat,
    /// What it spans.
    pub frustum: Frustum,
    /// Pixels of the target.
    pub size: [u32; 2],
    /// Stops; each doubles the brightness.
    pub exposure_ev: f32,
    /// View transform.
    pub tone_map: ToneMap,
    /// A thin circle about a direction of the world, of so many radians.
    pub marker: Option<(Vec3, f32)>,
}

/// A pass over some rows of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    pub pass: Pass,
    pub level: u32,
    pub first_row: u32,
    pub rows: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pass {
    Resolve,
    Pull,
    Push,
}

/// The panorama on a device.
#[derive(Debug)]
pub struct Panorama {
    size: [u32; 2],
    /// One view a level: mean radiance and confidence.
    pub(crate) known: Vec<wgpu::TextureView>,
    /// One view a level: radiance without holes.
    pub(crate) filled: Vec<wgpu::TextureView>,
    pub(crate) all_filled: wgpu::TextureView,
    pub(crate) sampler: wgpu::Sampler,
    pub(crate) steps: Vec<Step>,
    pub(crate) next_step: usize,
}

impl Panorama {
    /// An empty, black panorama for a film; `None` when the film is none, or does not fit the device's
    /// textures or memory.
    pub fn new(gpu: &Gpu, film: &FilmOptions) -> Option<Self> {
        let size = [film.width, film.height];
        let limit = gpu.device.limits().max_texture_dimension_2d;
        if film.mapping != FilmMapping::Equirect || size.iter().any(|side| !(1..=limit).contains(side)) {
            return None;
        }
        // Down to a single row.
        let levels = film.height.ilog2() + 1;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let texture = |label| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: levels,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            })
        };
        let views = |texture: &wgpu::Texture| {
            let level = |base_mip_level| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    base_mip_level,
                    mip_level_count: Some(1),
                    ..Default::default()
                })
            };
            (0..levels).map(level).collect()
        };
        let (known, filled) = (texture("panorama, known"), texture("panorama, filled"));
        if pollster::block_on(scope.pop()).is_some() {
            return None;
        }
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("panorama"),
            address_mode_u: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        Some(Self {
            size,
            known: views(&known),
            filled: views(&filled),
            all_filled: filled.create_view(&wgpu::TextureViewDescriptor::default()),
            sampler,
            steps: steps(size, levels),
            next_step: 0,
        })
    }

    /// Texels across and down.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Whether this is the panorama of such a film.
    pub fn fits(&self, film: &FilmOptions) -> bool {
        film.mapping == FilmMapping::Equirect && self.size == [film.width, film.height]
    }

    pub(crate) fn step_texels(&self, step: &Step) -> u64 {
        u64::from(level_size(self.size, step.level)[0]) * u64::from(step.rows)
    }
}

/// Texels of a level.
pub(crate) fn level_size(size: [u32; 2], level: u32) -> [u32; 2] {
    size.map(|side| (side >> level).max(1))
}

/// A whole refresh: what is known from fine to coarse, then what is shown from coarse to fine.
fn steps(size: [u32; 2], levels: u32) -> Vec<Step> {
    let rows_of = |pass: Pass, level: u32| {
        let [width, height] = level_size(size, level);
        let stride = (STEP_TEXELS / width).max(1);
        (0..height).step_by(stride as usize).map(move |first_row| Step {
            pass,
            level,
            first_row,
            rows: stride.min(height - first_row),
        })
    };
    let resolve = rows_of(Pass::Resolve, 0);
    let pull = (1..levels).flat_map(|level| rows_of(Pass::Pull, level));
    let push = (0..levels).rev().flat_map(|level| rows_of(Pass::Push, level));
    resolve.chain(pull).chain(push).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refresh_covers_every_row_of_every_level_once_in_order() {
        let size = [2048, 1024];
        let all = steps(size, 11);
        for pass in [Pass::Resolve, Pass::Pull, Pass::Push] {
            for level in 0..11 {
                let rows: Vec<u32> = all
                    .iter()
                    .filter(|step| step.pass == pass && step.level == level)
                    .flat_map(|step| step.first_row..step.first_row + step.rows)
                    .collect();
                let has = match pass {
                    Pass::Resolve => level == 0,
                    Pass::Pull => level > 0,
                    Pass::Push => true,
                };
                let expected = if has { level_size(size, level)[1] } else { 0 };
                assert_eq!(rows, (0..expected).collect::<Vec<_>>(), "{pass:?} {level}");
            }
        }
        let order: Vec<i64> = all
            .iter()
            .map(|step| match step.pass {
                Pass::Resolve => 0,
                Pass::Pull => i64::from(step.level),
                Pass::Push => 100 - i64::from(step.level),
            })
            .collect();
        assert!(order.is_sorted());
        assert!(all.iter().all(|step| level_size(size, step.level)[0] * step.rows <= STEP_TEXELS));
    }
}
