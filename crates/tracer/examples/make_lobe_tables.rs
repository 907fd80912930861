//! Writes `assets/lobe_tables.bin`, the directional albedos that the kernels interpolate.

fn main() -> std::io::Result<()> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/lobe_tables.bin");
    let numbers = tracer::upload::lobe_albedos().concat();
    let bytes: Vec<u8> = numbers.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
    std::fs::write(path, bytes)
}
