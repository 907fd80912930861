//! The size of a monitor from its EDID, which the system reads from the monitor.
//!
//! Reference: VESA E-EDID 1.4, sections 3.6 (size in centimetres) and 3.10.2 (detailed timing, size in millimetres).

/// What a monitor says about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorSize {
    /// Preferred width and height, pixels.
    pub size_px: [u32; 2],
    /// Width and height of the picture, millimetres.
    pub size_mm: [f32; 2],
}

/// From the first block of an EDID; `None` when it is none, or names no size (projectors do not).
pub fn monitor_size(edid: &[u8]) -> Option<MonitorSize> {
    let block = edid.first_chunk::<128>()?;
    let checksum = block.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    if block[..8] != [0, 255, 255, 255, 255, 255, 255, 0] || checksum != 0 {
        return None;
    }
    let timing = &block[54..72];
    // A pixel clock of 0 marks a text instead of a timing.
    if timing[0] == 0 && timing[1] == 0 {
        return None;
    }
    let wide = |low: usize, high: u8| u32::from(timing[low]) | u32::from(high) << 8;
    let size_px = [wide(2, timing[4] >> 4), wide(5, timing[7] >> 4)];
    let fine = [wide(12, timing[14] >> 4), wide(13, timing[14] & 15)].map(|mm| mm as f32);
    let coarse = [block[21], block[22]].map(|cm| f32::from(cm) * 10.0);
    // Some monitors give their aspect ratio, such as 16 x 9, where the millimetres belong.
    let plausible = |size: &[f32; 2]| size.iter().all(|side| *side >= 50.0);
    let size_mm = [fine, coarse].into_iter().find(plausible)?;
    (size_px[0] > 0 && size_px[1] > 0).then_some(MonitorSize { size_px, size_mm })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 24-inch monitor of 1920 x 1080 pixels, 531 x 299 mm.
    fn edid() -> [u8; 128] {
        let mut block = [0_u8; 128];
        block[1..7].fill(255);
        (block[21], block[22]) = (53, 30);
        let timing = [0x02, 0x3a, 0x80, 0, 0x70, 0x38, 0, 0x40, 0, 0, 0, 0, 0x13, 0x2b, 0x21];
        block[54..69].copy_from_slice(&timing);
        seal(block)
    }

    fn seal(mut block: [u8; 128]) -> [u8; 128] {
        block[127] = 0;
        block[127] = block.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
        block
    }

    #[test]
    fn pixels_and_millimetres_are_read() {
        let expected = MonitorSize { size_px: [1920, 1080], size_mm: [531.0, 299.0] };
        assert_eq!(monitor_size(&edid()), Some(expected));
    }

    #[test]
    fn an_aspect_ratio_in_place_of_millimetres_is_not_believed() {
        let mut block = edid();
        block[66..69].copy_from_slice(&[16, 9, 0]);
        assert_eq!(monitor_size(&seal(block)).map(|size| size.size_mm), Some([530.0, 300.0]));
        (block[21], block[22]) = (0, 0);
        assert_eq!(monitor_size(&seal(block)), None);
    }

    #[test]
    fn what_is_no_edid_is_refused() {
        let good = edid();
        assert_eq!(monitor_size(&good[..127]), None);
        let mut broken = good;
        broken[60] ^= 1;
        assert_eq!(monitor_size(&broken), None);
        let mut text = good;
        text[54..56].fill(0);
        assert_eq!(monitor_size(&seal(text)), None);
    }
}
