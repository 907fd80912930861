//! The pose of the nodes: as the file states it, or as its animations have it at a time.

use std::collections::HashSet;

use glam::{DAffine3, DQuat, DVec3};

use super::accessor::Data;
use super::document::{Channel, ChannelPath, Interpolation, Local, unit_or_identity};
use super::error::{ContentError, Fault};

/// Local transforms and morph weights of all nodes.
pub(super) struct Pose {
    pub(super) locals: Vec<Local>,
    /// Weights that an animation sets, by node.
    pub(super) weights: Vec<Option<Vec<f32>>>,
}

impl Pose {
    /// The pose at `time_secs`; without a time, the file's own. All animations of the file play together from 0; where
    /// several move the same property the first one counts. Before its first key and after its last a channel holds still.
    pub(super) fn at(data: &Data<'_>, time_secs: Option<f32>) -> Result<Self, Fault> {
        let document = data.document;
        let mut pose = Self {
            locals: document.nodes.iter().map(|n| n.local).collect(),
            weights: document.nodes.iter().map(|n| n.weights.clone()).collect(),
        };
        let Some(time_secs) = time_secs.filter(|t| t.is_finite()) else { return Ok(pose) };
        let mut done = HashSet::new();
        for channel in document.animations.iter().flat_map(|a| &a.channels) {
            if done.insert((channel.node, channel.path)) {
                pose.apply(data, channel, time_secs)?;
            }
        }
        Ok(pose)
    }

    fn apply(&mut self, data: &Data<'_>, channel: &Channel, time_secs: f32) -> Result<(), Fault> {
        let is_rotation = channel.path == ChannelPath::Rotation;
        let Some(values) = sample(data, channel, time_secs, is_rotation)? else { return Ok(()) };
        if channel.path == ChannelPath::Weights {
            self.weights[channel.node] = Some(values);
            return Ok(());
        }
        let wide: Vec<f64> = values.into_iter().map(f64::from).collect();
        // A node with a matrix may not be animated; one that is all the same starts from the matrix's parts.
        let local = &mut self.locals[channel.node];
        if let Local::Matrix(matrix) = *local {
            let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
            *local = Local::Trs { translation, rotation, scale };
        }
        if let Local::Trs { translation, rotation, scale } = local {
            match (channel.path, wide.as_slice()) {
                (ChannelPath::Translation, &[x, y, z]) => *translation = DVec3::new(x, y, z),
                (ChannelPath::Scale, &[x, y, z]) => *scale = DVec3::new(x, y, z),
                (ChannelPath::Rotation, &[x, y, z, w]) => *rotation = unit_or_identity(DQuat::from_xyzw(x, y, z, w)),
                _ => {
                    let cause = ContentError::AccessorType("its output has the wrong number of components".to_owned());
                    return Err(Fault::new(channel.place.clone(), cause));
                }
            }
        }
        Ok(())
    }
}

/// The time of the last key of any animation, seconds.
pub(super) fn duration_secs(data: &Data<'_>) -> Result<f32, Fault> {
    let inputs: HashSet<usize> = data.document.animations.iter().flat_map(|a| &a.channels).map(|c| c.input).collect();
    let mut longest = 0.0f32;
    for input in inputs {
        let last = data.floats::<1>(input, "animation input")?.last().map_or(0.0, |[t]| *t);
        longest = longest.max(if last.is_finite() { last } else { 0.0 });
    }
    Ok(longest)
}

/// The channel's value; `None` when it has no keys.
fn sample(data: &Data<'_>, channel: &Channel, time: f32, is_rotation: bool) -> Result<Option<Vec<f32>>, Fault> {
    let times = data.floats::<1>(channel.input, "animation input")?.into_flattened();
    let values = data.scalars(channel.output, "animation output")?;
    let per_key = if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let Some(width) = values.len().checked_div(times.len() * per_key).filter(|&width| width > 0) else {
        return Ok(None);
    };
    let after = times.partition_point(|&t| t <= time);
    let (from, to) = (after.saturating_sub(1), after.min(times.len() - 1));
    let span = times[to] - times[from];
    let s = if span > 0.0 { ((time - times[from]) / span).clamp(0.0, 1.0) } else { 0.0 };
    let part = |key: usize, part: usize| {
        let start = (key * per_key + part) * width;
        &values[start..start + width]
    };
    Ok(Some(match channel.interpolation {
        Interpolation::Step => part(from, 0).to_vec(),
        Interpolation::Linear if is_rotation && width == 4 => {
            let key = |k| DQuat::from_slice(&part(k, 0).iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
            let turned = unit_or_identity(key(from)).slerp(unit_or_identity(key(to)), f64::from(s));
            turned.as_quat().to_array().to_vec()
        }
        Interpolation::Linear => part(from, 0).iter().zip(part(to, 0)).map(|(a, b)| a + s * (b - a)).collect(),
        Interpolation::CubicSpline => hermite(s, span, part(from, 1), part(from, 2), part(to, 0), part(to, 1)),
    }))
}

/// glTF 2.0, appendix C.5: `out` is the tangent that leaves the first key, `into` the one that enters the second.
fn hermite(s: f32, span: f32, from: &[f32], out: &[f32], into: &[f32], to: &[f32]) -> Vec<f32> {
    let (s2, s3) = (s * s, s * s * s);
    let weights = [2.0 * s3 - 3.0 * s2 + 1.0, span * (s3 - 2.0 * s2 + s), 3.0 * s2 - 2.0 * s3, span * (s3 - s2)];
    let value = |i: usize| weights[0] * from[i] + weights[1] * out[i] + weights[2] * to[i] + weights[3] * into[i];
    (0..from.len()).map(value).collect()
}

/// World transforms of all nodes. Fails when the nodes do not form trees.
pub(super) fn world_from_node(data: &Data<'_>, pose: &Pose) -> Result<Vec<DAffine3>, Fault> {
    let nodes = &data.document.nodes;
    let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            if parent[child].replace(index).is_some() {
                return Err(Fault::new(nodes[child].place.clone(), ContentError::NodeGraph));
            }
        }
    }
    let mut world = vec![None; nodes.len()];
    let mut open: Vec<usize> = (0..nodes.len()).filter(|&n| parent[n].is_none()).collect();
    while let Some(node) = open.pop() {
        let above = parent[node].and_then(|p| world[p]).unwrap_or(DAffine3::IDENTITY);
        world[node] = Some(above * pose.locals[node].affine());
        open.extend(&nodes[node].children);
    }
    match world.iter().position(Option::is_none) {
        Some(node) => Err(Fault::new(nodes[node].place.clone(), ContentError::NodeGraph)),
        None => Ok(world.into_iter().flatten().collect()),
    }
}
