//! Nodes and the animations that move them.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat4, DQuat, DVec3};

use super::super::error::Fault;
use super::super::json::Object;
use super::{attribute_map, weights};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::import) enum Local {
    Matrix(DAffine3),
    Trs { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    pub(in crate::import) fn affine(self) -> DAffine3 {
        match self {
            Self::Matrix(matrix) => matrix,
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, unit_or_identity(rotation), translation)
            }
        }
    }
}

pub(in crate::import) fn unit_or_identity(q: DQuat) -> DQuat {
    let length = q.length();
    if length.is_finite() && length > 0.0 { q / length } else { DQuat::IDENTITY }
}

pub(in crate::import) struct Node {
    pub(in crate::import) place: String,
    pub(in crate::import) name: String,
    pub(in crate::import) local: Local,
    pub(in crate::import) children: Vec<usize>,
    pub(in crate::import) mesh: Option<usize>,
    pub(in crate::import) skin: Option<usize>,
    pub(in crate::import) camera: Option<usize>,
    pub(in crate::import) light: Option<usize>,
    pub(in crate::import) weights: Option<Vec<f32>>,
    pub(in crate::import) visible: bool,
    /// Accessors of EXT_mesh_gpu_instancing by attribute name.
    pub(in crate::import) instancing: Option<BTreeMap<String, usize>>,
}

pub(in crate::import) struct Animation {
    pub(in crate::import) channels: Vec<Channel>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::import) enum ChannelPath {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::import) enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

pub(in crate::import) struct Channel {
    pub(in crate::import) place: String,
    pub(in crate::import) node: usize,
    pub(in crate::import) path: ChannelPath,
    pub(in crate::import) interpolation: Interpolation,
    pub(in crate::import) input: usize,
    pub(in crate::import) output: usize,
}

pub(super) struct NodeLimits {
    pub(super) nodes: usize,
    pub(super) meshes: usize,
    pub(super) skins: usize,
    pub(super) cameras: usize,
    pub(super) lights: usize,
    pub(super) accessors: usize,
}

impl Node {
    pub(super) fn parse(o: Object<'_>, limits: &NodeLimits) -> Result<Self, Fault> {
        let local = if let Some(matrix) = o.numbers::<16>("matrix")? {
            Local::Matrix(DAffine3::from_mat4(DMat4::from_cols_array(&matrix)))
        } else {
            Local::Trs {
                translation: o.numbers("translation")?.map_or(DVec3::ZERO, DVec3::from_array),
                rotation: o.numbers("rotation")?.map_or(DQuat::IDENTITY, DQuat::from_array),
                scale: o.numbers("scale")?.map_or(DVec3::ONE, DVec3::from_array),
            }
        };
        let instancing = match o.extension("EXT_mesh_gpu_instancing")? {
            Some(extension) => {
                extension.object("attributes")?.map(|a| attribute_map(&a, limits.accessors)).transpose()?
            }
            None => None,
        };
        Ok(Self {
            name: o.name().to_owned(),
            local,
            children: o.indices("children", "node", limits.nodes)?,
            mesh: o.index("mesh", "mesh", limits.meshes)?,
            skin: o.index("skin", "skin", limits.skins)?,
            camera: o.index("camera", "camera", limits.cameras)?,
            light: match o.extension("KHR_lights_punctual")? {
                Some(extension) => extension.index("light", "light", limits.lights)?,
                None => None,
            },
            weights: weights(&o)?,
            visible: o.extension("KHR_node_visibility")?.map_or(Ok(true), |e| e.bool_or("visible", true))?,
            instancing,
            place: o.place,
        })
    }
}

impl Animation {
    pub(super) fn parse(o: &Object<'_>, nodes: usize, accessors: usize) -> Result<Self, Fault> {
        let samplers = o.objects("samplers", "sampler")?;
        let mut channels = Vec::new();
        for channel in o.objects("channels", "channel")? {
            let sampler = &samplers[channel.required_index("sampler", "sampler", samplers.len())?];
            let target = channel.object("target")?.ok_or_else(|| channel.bad("target", "is missing"))?;
            let path = match target.string("path")? {
                Some("translation") => ChannelPath::Translation,
                Some("rotation") => ChannelPath::Rotation,
                Some("scale") => ChannelPath::Scale,
                Some("weights") => ChannelPath::Weights,
                // "pointer" belongs to KHR_animation_pointer, which the report names as ignored.
                _ => continue,
            };
            let Some(node) = target.index("node", "node", nodes)? else { continue };
            let interpolation = match sampler.string("interpolation")? {
                None | Some("LINEAR") => Interpolation::Linear,
                Some("STEP") => Interpolation::Step,
                Some("CUBICSPLINE") => Interpolation::CubicSpline,
                Some(_) => return Err(sampler.bad("interpolation", "is not known")),
            };
            channels.push(Channel {
                node,
                path,
                interpolation,
                input: sampler.required_index("input", "accessor", accessors)?,
                output: sampler.required_index("output", "accessor", accessors)?,
                place: channel.place,
            });
        }
        Ok(Self { channels })
    }
}
