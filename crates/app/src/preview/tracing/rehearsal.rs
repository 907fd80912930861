//! The first move of an object, rehearsed in a thread of its own while the film rests.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};
use std::thread::JoinHandle;
use std::time::Duration;

use tracer::kernels::{Kernel, KernelKey};
use tracer::renderer::Rehearsed;

use super::{Open, Tracing};
use crate::preview::engine::give_way;

/// Tracing of one film after which it has come to rest: nobody edits just now, and the picture has had the machine to itself.
const AFTER: Duration = Duration::from_secs(3);

/// What has been rehearsed, and is.
#[derive(Default)]
pub(super) struct Rehearsals {
    thread: Option<JoinHandle<Option<Rehearsed>>>,
    should_stop: Arc<AtomicBool>,
    /// The kernel that a move was last rehearsed for.
    last: Option<KernelKey>,
}

impl Tracing {
    /// Lets the driver compile the kernels of an object's first move, once for each kernel that nothing was moved with, so that the
    /// move need not wait for them.
    pub fn rehearse(&mut self) {
        let rehearsals = &mut self.rehearsals;
        let Some(Open { scene, renderer: Some(renderer), .. }) = &mut self.open else { return };
        let is_done = rehearsals.thread.as_ref().is_some_and(JoinHandle::is_finished);
        if let Some(thread) = rehearsals.thread.take_if(|_| is_done) {
            // A panic has been reported by the panic hook.
            thread.join().ok().flatten().into_iter().for_each(|rehearsed| renderer.take_in(rehearsed));
        }
        if rehearsals.thread.is_some() || self.traced < AFTER {
            return;
        }
        let key = renderer.key(Kernel::Trace);
        if rehearsals.last.as_ref() == Some(&key) {
            return;
        }
        rehearsals.last = Some(key);
        let Some(rehearsal) = renderer.rehearsal(scene) else { return };
        let should_stop = rehearsals.should_stop.clone();
        let run = move || {
            // The adapter's threads inherit this.
            give_way();
            // Without a rehearsal the move takes longer, and what stands in its way is told then.
            rehearsal.run(&should_stop).ok().flatten()
        };
        rehearsals.thread = std::thread::Builder::new().name("rehearsal".into()).spawn(run).ok();
    }
}

impl Drop for Rehearsals {
    /// Waits: a driver must not compile on while the process ends.
    fn drop(&mut self) {
        self.should_stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
