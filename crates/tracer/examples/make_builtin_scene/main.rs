//! Writes `assets/builtin.glb`, the scene that the program shows when no file is named.
//!
//! Run it after a change to the set: `cargo run -p tracer --example make_builtin_scene`. The result has the same bytes
//! on every run; a test compares it with the file that is committed.

mod set;

fn main() -> std::io::Result<()> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/builtin.glb");
    std::fs::write(path, set::glb())
}
