//! The hierarchies' traversal on the device against brute force over all triangles in f64.
//!
//! For every ray (i) the point that the device reports lies on the triangle that it reports, and (ii) no triangle that the
//! ray certainly meets lies nearer. Both hold whatever the triangles' shapes: a sliver or an edge can only make a meeting
//! uncertain, never a far hit right.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_sampler::sequence::hash;
use fovea_tests::{
    device,
    plant::instead_of_paths,
    scenes::{Builder, lambert},
};
use glam::{Affine3A, DAffine3, DVec3, Quat, Vec3};
use tracer::{
    bvh::{Blas, HierarchyKind, Tlas, TlasEntry},
    distribution::Distribution,
    film::FilmOptions,
    kernels::FILM_WORDS,
    renderer::{Renderer, RendererOptions},
    scene::{AlphaMode, Material, Scene},
};

/// One a pixel.
const FILM: FilmOptions = FilmOptions::equirect(128, 128);
/// Metres: how far a reported point may be from a well-shaped triangle, and how near an edge makes a meeting uncertain.
/// Coordinates are below 4 metres, so this is about 20 roundings.
const UNCERTAINTY: f64 = 1e-5;

/// The same for a point at `reach` metres from the origin, by the triangle's shape and the ray's slant: the corners' rounding
/// turns the normal of a sliver, and with it moves the point along the ray.
fn uncertainty(direction: DVec3, [a, b, c]: [DVec3; 3], reach: f64) -> f64 {
    let normal = (b - a).cross(c - a);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let cosine = (normal.dot(direction) / (normal.length() * direction.length())).abs();
    UNCERTAINTY * (1.0 + reach) * (1.0 + 0.1 * longest / (normal.length() * cosine))
}

/// Rays by number, in arithmetic that is exact on both sides: origins in a box of 4 metres, or all at one point, and
/// directions of any length up to sqrt(3), along the axes now and then.
fn ray(number: u32) -> (DVec3, DVec3) {
    let h = |k: u32| hash(number.wrapping_mul(8).wrapping_add(k));
    let part = |k: u32| (f64::from(h(k) >> 16) - 32768.0) / 32768.0;
    let mut origin = DVec3::new(part(0), part(1), part(2)) * 2.0;
    let mut direction = DVec3::new(part(3), part(4), part(5));
    if number % 4 == 1 {
        origin = DVec3::new(0.0, 0.0, 3.0);
    }
    if number % 16 == 2 {
        direction = DVec3::Z * -0.5;
    }
    (origin, direction)
}

const IMPORTS: &str = "
import package::sampler::hash_u32;
import package::path_bindings::instances;
import package::scene::tables::triangle_at;
import package::types::TRIANGLE_ALPHA;
import package::scene::traverse::{Ray, HitPair, RAY_ANY, RAY_CLOSEST};
@if(ALPHA) import package::scene::alpha::trace_through;
@if(!ALPHA) import package::scene::traverse::traverse_pair;
import package::scene::surface::part_of;";

const ITEMS: &str = "
fn part(number: u32, k: u32) -> f32 {
    return (f32(hash_u32(number * 8u + k) >> 16u) - 32768.0) / 32768.0;
}";

/// Distance, triangle's number in its mesh and material of the nearest hit, all exact in the film's quanta; any hit too.
const BODY: &str = "
    pixel = index;
    var origin = vec3f(part(index, 0u), part(index, 1u), part(index, 2u)) * 2.0;
    var direction = vec3f(part(index, 3u), part(index, 4u), part(index, 5u));
    if index % 4u == 1u {
        origin = vec3f(0.0, 0.0, 3.0);
    }
    if index % 16u == 2u {
        direction = vec3f(0.0, 0.0, -0.5);
    }
    var hits: HitPair;
    let for_any = Ray(origin, direction, 0.0, 3.0e38, RAY_ANY);
    let for_closest = Ray(origin, direction, 0.0, 3.0e38, RAY_CLOSEST);
    @if(ALPHA) {
        var transmittance = vec3f(1.0);
        hits = trace_through(for_any, for_closest, 1u, &transmittance);
    }
    @if(!ALPHA) {
        hits = traverse_pair(for_any, for_closest);
    }
    let any = hits.first;
    let hit = hits.second;
    if hit.instance != NONE {
        let number = triangle_at(hit.triangle).w & ~TRIANGLE_ALPHA;
        let source = instances[part_of(hit.instance, triangle_at(hit.triangle).x)].material;
        radiance = vec3f(hit.t * 0.00390625, f32(number) * 0.00000095367431640625, f32(source + 1u) * 0.00390625);
    }
    if (any.instance != NONE) != (hit.instance != NONE) {
        radiance.z = 15.0;
    }";

/// Nearest hits of all rays by one kind of hierarchy: distance in units of the direction, triangle, instance.
fn hits(scene: &Scene, kind: HierarchyKind) -> Vec<Option<(f64, u32, u32)>> {
    let gpu = device::gpu();
    let options = RendererOptions { film: FILM, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    instead_of_paths(&mut renderer, Clone::clone, [IMPORTS, ITEMS, BODY]);
    renderer.set_hierarchy(kind);
    renderer.set_scene(scene).unwrap();
    let film = device::trace(&mut renderer, FILM.pixels()).unwrap();
    assert_eq!(renderer.statistics().unwrap().clamped, 0, "a distance does not fit the film");
    film.words
        .chunks_exact(FILM_WORDS as usize)
        .map(|words| {
            assert_eq!(words[6], 1);
            let value = |low: usize| {
                (f64::from(words[low]) + f64::from(words[low + 1]) * 4_294_967_296.0) / film.header.radiance_scale
            };
            let source = (value(4) * 256.0) as u32;
            assert!(source < 15 * 256, "the nearest hit and any hit disagree on whether there is one");
            (source > 0).then(|| (value(0) * 256.0, (value(2) * 1_048_576.0) as u32, source - 1))
        })
        .collect()
}

/// Distance of a point from a triangle (its interior, edges and corners).
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let to_segment = |a: DVec3, b: DVec3| {
        let edge = b - a;
        let t =
            if edge.length_squared() > 0.0 { ((p - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0) } else { 0.0 };
        (p - a - edge * t).length()
    };
    let normal = (b - a).cross(c - a);
    let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) >= 0.0;
    if normal.length_squared() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(normal.normalize()).abs();
    }
    to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a))
}

/// The farthest that the device may report where a ray certainly meets a triangle: well inside its edges, not grazing, in
/// front of the origin.
fn certain_meeting(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(c - a);
    let along = normal.dot(direction);
    if along.abs() <= 0.01 * normal.length() * direction.length() {
        return None;
    }
    let t = normal.dot(a - origin) / along;
    if t * direction.length() <= UNCERTAINTY {
        return None;
    }
    let p = origin + t * direction;
    let n = normal.normalize();
    let clearance = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(n) / (b - a).length();
    let least = clearance(a, b).min(clearance(b, c)).min(clearance(c, a));
    // A slanted ray carries the rounding of its distance sideways.
    let speed = direction.length();
    (least > UNCERTAINTY * 10.0).then(|| t + uncertainty(direction, [a, b, c], t * speed) / speed)
}

fn check(name: &str, scene: &Scene) {
    let _time = device::Stopwatch::start("brute force");
    for kind in [HierarchyKind::Wide, HierarchyKind::Binary] {
        compare(&format!("{name}, {kind:?}"), scene, &hits(scene, kind));
    }
}

fn compare(name: &str, scene: &Scene, found: &[Option<(f64, u32, u32)>]) {
    let triangles: Vec<Vec<[DVec3; 3]>> = scene
        .instances
        .iter()
        .map(|instance| {
            let place = DAffine3::from_mat4(glam::Mat4::from(instance.world_from_mesh).as_dmat4());
            let mesh = &scene.meshes[instance.mesh as usize];
            let corner = |v: u32| place.transform_point3(mesh.positions[v as usize].as_dvec3());
            mesh.triangles.iter().map(|t| t.map(corner)).collect()
        })
        .collect();
    // A sphere about each instance spares most of the work; it is obviously right.
    let spheres: Vec<(DVec3, f64)> = triangles
        .iter()
        .map(|list| {
            let points = || list.iter().flatten();
            let centre = points().copied().sum::<DVec3>() / (3 * list.len()) as f64;
            (centre, points().map(|p| p.distance(centre)).fold(0.0, f64::max) + 1e-9)
        })
        .collect();
    let (mut hit_count, mut certain) = (0, 0);
    for (number, found) in found.iter().enumerate() {
        let (origin, direction) = ray(number as u32);
        let speed = direction.length();
        let mut nearest = f64::INFINITY;
        for (list, (centre, radius)) in triangles.iter().zip(&spheres) {
            let closest = (centre - origin).cross(direction).length() / speed;
            if closest <= *radius {
                nearest = list.iter().filter_map(|&t| certain_meeting(origin, direction, t)).fold(nearest, f64::min);
            }
        }
        certain += usize::from(nearest.is_finite());
        let Some((t, triangle, instance)) = *found else {
            assert!(nearest.is_infinite(), "{name}: ray {number} misses what it certainly meets at {nearest}");
            continue;
        };
        hit_count += 1;
        let triangle = triangles[instance as usize][triangle as usize];
        let off = distance(origin + t * direction, triangle);
        let allowed = uncertainty(direction, triangle, t * speed);
        assert!(off <= allowed, "{name}: ray {number} ends {off} m, not {allowed}, off {triangle:?}");
        assert!(t <= nearest, "{name}: ray {number} passes a triangle at {nearest} and stops at {t}");
    }
    eprintln!("{name}: {} rays, {hit_count} hits, {certain} of them certain by brute force", found.len());
}

fn random_point(index: u32) -> Vec3 {
    let part = |k: u32| (hash(index * 4 + k) >> 8) as f32 / 16_777_216.0 * 2.0 - 1.0;
    Vec3::new(part(0), part(1), part(2))
}

/// Triangles of edges up to `size` metres with centres in a box of 4 metres.
fn soup(count: u32, size: f32, seed: u32) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|i| {
            let at = |k: u32| random_point(seed.wrapping_add(i * 4 + k));
            let centre = at(0) * 2.0;
            [centre, centre + at(1) * size, centre + at(2) * size]
        })
        .collect()
}

fn single(name: &str, triangles: &[[Vec3; 3]], material: Material) {
    let mut builder = Builder::new(Vec3::ONE);
    let material = builder.material(material);
    let mesh = builder.triangles(triangles, &[]);
    builder.place(mesh, material, Affine3A::IDENTITY);
    check(name, &builder.build());
}

fn white() -> Material {
    lambert(Vec3::ONE)
}

#[test]
fn random_triangles() {
    single("soup", &soup(2000, 0.5, 1), white());
    single("small triangles", &soup(2000, 0.05, 2), white());
    single("one triangle", &soup(1, 3.0, 12), white());
}

#[test]
fn slivers_degenerates_duplicates_and_coplanar_triangles() {
    let slivers: Vec<[Vec3; 3]> =
        soup(1500, 2.0, 3).iter().map(|[a, b, c]| [*a, *b, a.lerp(*b, 0.5) + (*c - *a) * 2e-3]).collect();
    let degenerate: Vec<[Vec3; 3]> = soup(300, 1.0, 4)
        .iter()
        .enumerate()
        .map(|(i, &[a, b, _])| if i % 2 == 0 { [a, b, a.lerp(b, 0.25)] } else { [a, a, a] })
        .collect();
    let ordinary = soup(600, 0.7, 5);
    single("slivers", &slivers, white());
    single("degenerates among others", &[&degenerate[..], &ordinary].concat(), white());
    single("only degenerates", &degenerate, white());
    single("duplicates", &[&ordinary[..], &ordinary, &ordinary].concat(), white());
    // A tessellated square at z = 0 with a copy that overlaps it half a cell further.
    let grid = |shift: f32| {
        (0..400).flat_map(move |i| {
            let corner = Vec3::new((i % 20) as f32 * 0.2 - 2.0 + shift, (i / 20) as f32 * 0.2 - 2.0 + shift, 0.0);
            let (x, y) = (Vec3::X * 0.2, Vec3::Y * 0.2);
            [[corner, corner + x, corner + x + y], [corner, corner + x + y, corner + y]]
        })
    };
    single("coplanar", &grid(0.0).chain(grid(0.1)).collect::<Vec<_>>(), white());
}

/// A mask whose texels are all opaque changes the kernel, not the hits, up to a cutoff of 1; above it nothing is there.
#[test]
fn alpha_tests_leave_opaque_triangles_alone() {
    let masked = |cutoff: f32| Material { alpha_mode: AlphaMode::Mask { cutoff }, ..white() };
    single("alpha mask", &soup(500, 0.6, 6), masked(0.5));
    single("alpha mask with a cutoff of 1", &soup(500, 0.6, 6), masked(1.0));
    let mut builder = Builder::new(Vec3::ONE);
    let material = builder.material(masked(1.5));
    let mesh = builder.triangles(&soup(500, 0.6, 6), &[]);
    builder.place(mesh, material, Affine3A::IDENTITY);
    assert!(hits(&builder.build(), HierarchyKind::Wide).iter().all(Option::is_none));
}

/// Few copies join the static mesh, many keep a hierarchy of their own: both, with mirrors and unequal scales.
/// Things can be moved anywhere; the area of a box that overflows would end in a panic of the builder.
#[test]
fn hierarchies_beyond_all_measure() {
    for kind in [HierarchyKind::Wide, HierarchyKind::Binary] {
        let mut corners = soup(60, 0.5, 9);
        corners[7][1] = Vec3::splat(f32::MAX);
        corners[31][2] = Vec3::new(-2e38, 0.0, 2e38);
        let triangles: Vec<[u32; 3]> = (0..60).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let blas = Arc::new(Blas::build(kind, corners.as_flattened(), &triangles));
        assert_eq!(blas.triangle_order.len(), 60);
        let placed = |i: u32| Affine3A::from_scale(Vec3::splat(10f32.powi(i as i32)));
        let entries: Vec<_> = (0..38)
            .map(|i| TlasEntry { world_from_mesh: placed(i), blas: Arc::clone(&blas), source: Some(i) })
            .collect();
        assert_eq!(Tlas::build(kind, &entries).order.len(), 38);
    }
}

#[test]
fn instances() {
    for (triangles, copies) in [(300, 6), (4200, 8)] {
        let mut builder = Builder::new(Vec3::ONE);
        let shared = builder.triangles(&soup(triangles, 0.2, 7), &[]);
        let lone = builder.triangles(&soup(50, 0.8, 8), &[]);
        let materials: Vec<u32> = (0..=copies).map(|_| builder.material(white())).collect();
        for copy in 0..copies {
            let turn = Quat::from_euler(glam::EulerRot::XYZ, copy as f32, 0.3 * copy as f32, 1.0);
            let mirror = if copy % 2 == 0 { 1.0 } else { -1.0 };
            let scale = Vec3::new(0.2 * mirror, 0.3, 0.1 + 0.05 * copy as f32);
            let place = Affine3A::from_scale_rotation_translation(scale, turn, random_point(900 + copy) * 1.5);
            builder.place(shared, materials[copy as usize], place);
        }
        builder.place(lone, materials[copies as usize], Affine3A::IDENTITY);
        check(&format!("{copies} copies of {triangles} triangles"), &builder.build());
    }
}

/// The check itself notices a hierarchy that loses triangles: the brute force is given one more than the device.
#[test]
#[should_panic(expected = "certainly meets")]
fn a_lost_triangle_is_noticed() {
    let mut builder = Builder::new(Vec3::ONE);
    let material = builder.material(white());
    let mesh = builder.triangles(&soup(20, 0.5, 9), &[]);
    builder.place(mesh, material, Affine3A::IDENTITY);
    let mut scene = builder.build();
    let found = hits(&scene, HierarchyKind::Wide);
    let wall = [Vec3::new(-9.0, -9.0, -3.0), Vec3::new(9.0, -9.0, -3.0), Vec3::new(0.0, 9.0, -3.0)];
    let mut with_wall = (*scene.meshes[0]).clone();
    let first = with_wall.positions.len() as u32;
    with_wall.positions.extend(wall);
    with_wall.triangles.push([first, first + 1, first + 2]);
    scene.meshes[0] = Arc::new(with_wall);
    compare("lost triangle", &scene, &found);
}
