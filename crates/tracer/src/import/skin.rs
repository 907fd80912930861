//! Skinning: joint matrices of a pose and the joints that move each vertex.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::accessor::Data;
use super::document::{Primitive, Skin};
use super::error::{ContentError, Fault};

/// A skin farther than this from the world's origin (metres) is baked relative to its first joint, so that f32 vertices
/// keep their precision.
const ANCHOR_DISTANCE: f64 = 1024.0;

/// `anchor_from_mesh` of each joint, and the world position of the anchor.
pub(super) struct JointMatrices {
    matrices: Vec<DAffine3>,
    pub(super) anchor_in_world: DVec3,
}

impl JointMatrices {
    pub(super) fn new(data: &Data<'_>, skin: &Skin, world_from_node: &[DAffine3]) -> Result<Self, Fault> {
        let first = skin.joints.first().map_or(DVec3::ZERO, |&joint| world_from_node[joint].translation);
        let anchor_in_world = if first.length() > ANCHOR_DISTANCE { first } else { DVec3::ZERO };
        let inverse_bind = match skin.inverse_bind {
            Some(accessor) => data.floats::<16>(accessor, "inverseBindMatrices")?,
            None => Vec::new(),
        };
        if skin.inverse_bind.is_some() && inverse_bind.len() < skin.joints.len() {
            let (found, joints) = (inverse_bind.len(), skin.joints.len());
            let cause = ContentError::AccessorType(format!("{found} inverse bind matrices for {joints} joints"));
            return Err(Fault::new(skin.place.clone(), cause));
        }
        let matrices = skin.joints.iter().enumerate().map(|(i, &joint)| {
            let joint_from_mesh = inverse_bind
                .get(i)
                .map_or(DAffine3::IDENTITY, |m| DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from))));
            DAffine3::from_translation(-anchor_in_world) * world_from_node[joint] * joint_from_mesh
        });
        Ok(Self { matrices: matrices.collect(), anchor_in_world })
    }
}

/// Four joints and weights per vertex.
struct InfluenceSet {
    joints: Vec<[u32; 4]>,
    weights: Vec<[f32; 4]>,
}

/// Up to eight joints and weights per vertex.
pub(super) struct Influences {
    sets: Vec<InfluenceSet>,
}

impl Influences {
    pub(super) fn read(data: &Data<'_>, primitive: &Primitive, vertices: usize) -> Result<Self, Fault> {
        let mut sets = Vec::new();
        for set in 0..2 {
            let (joints, weights) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
            let accessors = (primitive.attributes.get(&joints), primitive.attributes.get(&weights));
            let (Some(&joint_accessor), Some(&weight_accessor)) = accessors else { continue };
            let set = InfluenceSet {
                joints: data.integers::<4>(joint_accessor, &joints)?,
                weights: data.floats::<4>(weight_accessor, &weights)?,
            };
            for (attribute, found) in [(joints, set.joints.len()), (weights, set.weights.len())] {
                if found != vertices {
                    let cause = ContentError::AttributeCount { attribute, found, expected: vertices };
                    return Err(Fault::new(primitive.place.clone(), cause));
                }
            }
            sets.push(set);
        }
        Ok(Self { sets })
    }

    /// The weighted mean of the joints' matrices; the first joint's where a vertex has no weight.
    pub(super) fn blend(&self, vertex: usize, joints: &JointMatrices, place: &str) -> Result<DAffine3, Fault> {
        let (mut linear, mut translation, mut total) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for set in &self.sets {
            for (&joint, &weight) in set.joints[vertex].iter().zip(&set.weights[vertex]) {
                if !(weight.is_finite() && weight > 0.0) {
                    continue;
                }
                let matrix = joints.matrices.get(joint as usize).ok_or_else(|| {
                    let joints = joints.matrices.len();
                    Fault::new(place, ContentError::Joint { vertex, joint, joints })
                })?;
                let weight = f64::from(weight);
                linear += matrix.matrix3 * weight;
                translation += matrix.translation * weight;
                total += weight;
            }
        }
        if total > 0.0 {
            return Ok(DAffine3 { matrix3: linear * (1.0 / total), translation: translation / total });
        }
        Ok(joints.matrices.first().copied().unwrap_or(DAffine3::IDENTITY))
    }
}
