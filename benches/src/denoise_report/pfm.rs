//! Portable float maps: linear pictures for other programs.

use std::path::Path;

use fovea_benches::AnyError;

/// Writes a picture, row by row from the top.
pub fn write(path: &Path, [width, height]: [u32; 2], texels: &[[f32; 3]]) -> Result<(), AnyError> {
    let mut bytes = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
    // The format begins at the bottom.
    for row in texels.chunks(width as usize).rev() {
        bytes.extend(row.iter().flatten().flat_map(|value| value.to_le_bytes()));
    }
    Ok(std::fs::write(path, bytes)?)
}

/// Reads a picture of a known size that [`write()`] or its like has written.
pub fn read(path: &Path, [width, height]: [u32; 2]) -> Result<Vec<[f32; 3]>, AnyError> {
    let bytes = std::fs::read(path)?;
    let header = format!("PF\n{width} {height}\n-1.0\n");
    let values = bytes.strip_prefix(header.as_bytes()).ok_or_else(|| format!("{}: another picture", path.display()))?;
    let values: Vec<f32> = values.as_chunks().0.iter().map(|value| f32::from_le_bytes(*value)).collect();
    if values.len() != 3 * width as usize * height as usize {
        return Err(format!("{}: cut off", path.display()).into());
    }
    let rows: Vec<&[[f32; 3]]> = values.as_chunks().0.chunks(width as usize).collect();
    Ok(rows.into_iter().rev().flatten().copied().collect())
}
