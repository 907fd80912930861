//! Binary hierarchies in the kernels' layout (`shaders/scene/traverse.wesl`): a node is a pair of children with their boxes, so that one visit decides on both.

use obvhs::bvh2::{Bvh2, node::Bvh2Node};

use super::{Built, Node};

/// In the second word of a child that is a node: as in a group of the traversal's stack.
const INNER: u32 = 0x8000_0000;

/// First word of each child: its box's lower corner and index, its upper corner and what it is.
const CHILDREN: [usize; 2] = [0, 8];

/// Pairs of children, each before those below it. A hierarchy of a single leaf is a pair with one child.
pub(super) fn encode(bvh: Bvh2) -> Built {
    let mut built = Built { nodes: Vec::new(), order: Vec::new(), bounds: Default::default(), depth: 1 };
    let Some(root) = bvh.nodes.first() else {
        built.nodes.push(Node::default());
        return built;
    };
    built.bounds = *root.aabb();
    if root.is_leaf() {
        let mut pair = Node::default();
        set_child(&mut pair, CHILDREN[0], root, root.first_index);
        built.nodes.push(pair);
    } else {
        // A pair to write: where its children stand in obvhs's nodes, the child of an earlier pair that it is, its level.
        let mut pending = vec![(root.first_index, None, 1)];
        while let Some((first, parent, level)) = pending.pop() {
            built.depth = built.depth.max(level);
            let number = built.nodes.len() as u32;
            if let Some((node, child)) = parent {
                let node: &mut Node = &mut built.nodes[node as usize];
                node.0[child + 3] = number;
            }
            let mut pair = Node::default();
            for (child, at) in bvh.nodes[first as usize..].iter().zip(CHILDREN) {
                set_child(&mut pair, at, child, child.first_index);
                if !child.is_leaf() {
                    pending.push((child.first_index, Some((number, at)), level + 1));
                }
            }
            built.nodes.push(pair);
        }
    }
    built.order = bvh.primitive_indices;
    built
}

fn set_child(pair: &mut Node, at: usize, child: &Bvh2Node, index: u32) {
    let aabb = child.aabb();
    // A bit for each triangle of a leaf: at most three, see `build_params`.
    let kind = if child.is_leaf() { (1 << child.prim_count) - 1 } else { INNER };
    let [low, high] = [aabb.min, aabb.max].map(|corner| corner.to_array().map(f32::to_bits));
    pair.0[at..at + 3].copy_from_slice(&low);
    pair.0[at + 3] = index;
    pair.0[at + 4..at + 7].copy_from_slice(&high);
    pair.0[at + 7] = kind;
}

/// A pair among other hierarchies' nodes and triangles.
pub(super) fn rebased(mut pair: Node, node_base: u32, primitive_base: u32) -> Node {
    for at in CHILDREN {
        pair.0[at + 3] += if pair.0[at + 7] == INNER { node_base } else { primitive_base };
    }
    pair
}
