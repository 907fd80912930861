//! The built-in scene: a room that has something to look at in every direction from its centre.
//!
//! -Z: a table with glass, metal, ceramics and fruit before a tapestry. +X: a window with plants and curtains.
//! +Z: a bookshelf. -X: a mirror, an eye chart and a row of metal spheres of growing roughness. The corners hold a plant,
//! a lantern on a chain, a reading lamp and an armchair.
//!
//! Coordinates are snapped to 2^-14 m and textures are made of integers or rounded values, so that the file does not
//! depend on the last bit of a platform's sine.

mod corners;
mod glb;
mod materials;
mod paint;
mod pattern;
mod room;
mod shape;
mod shelf;
mod still_life;
mod walls;

use glam::Vec3;

/// The scene as a binary glTF file.
pub(crate) fn glb() -> Vec<u8> {
    let mut scene = glb::Builder::default();
    let palette = materials::Palette::new(&mut scene);
    room::build(&mut scene, &palette);
    still_life::build(&mut scene, &palette);
    walls::build(&mut scene, &palette);
    shelf::build(&mut scene, &palette);
    corners::build(&mut scene, &palette);
    let eye = Vec3::new(0.0, 1.6, 0.0);
    scene.camera("Centre", eye, eye - Vec3::Z, 1.05);
    scene.camera("Still life", Vec3::new(-0.5, 1.22, -0.75), Vec3::new(0.1, 0.9, -2.0), 0.8);
    scene.camera("Window", Vec3::new(-1.2, 1.5, 0.6), Vec3::new(3.5, 1.35, -0.2), 0.9);
    scene.camera("Bookshelf", Vec3::new(0.5, 1.45, 0.9), Vec3::new(-0.2, 1.25, 3.6), 0.9);
    scene.camera("Metal row", Vec3::new(-1.5, 1.35, -0.9), Vec3::new(-3.3, 1.15, 0.25), 0.8);
    scene.finish()
}
