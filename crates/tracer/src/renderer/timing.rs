//! Seconds of device time by timestamp queries.

use super::{RenderError, Renderer};
use crate::film::read_buffer;

impl Renderer {
    /// Runs one compute pass alone and waits for it. Returns the seconds that the device took, `None` where the adapter has no
    /// timestamps.
    pub(super) fn timed_pass(
        &self,
        label: &str,
        record: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) -> Result<Option<f64>, RenderError> {
        let device = &self.gpu.device;
        let has_timestamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let queries = has_timestamps.then(|| {
            let ty = wgpu::QueryType::Timestamp;
            device.create_query_set(&wgpu::QuerySetDescriptor { label: Some(label), ty, count: 2 })
        });
        let mut encoder = self.encoder(label);
        {
            let timestamp_writes = queries.as_ref().map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            });
            record(
                &mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes }),
            );
        }
        let Some(queries) = queries else {
            self.gpu.queue.submit([encoder.finish()]);
            self.gpu.wait().map_err(|_| RenderError::DeviceLost)?;
            return Ok(None);
        };
        let times = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: 16,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.resolve_query_set(&queries, 0..2, &times, 0);
        self.gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<u64> = read_buffer(&self.gpu, &times)?;
        let period = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-9;
        Ok(ticks.get(1).zip(ticks.first()).map(|(end, start)| end.saturating_sub(*start) as f64 * period))
    }
}
