//! Work that must not hold the window up: each piece on a thread of its own, its result fetched by a later frame.

use std::sync::mpsc::{Receiver, Sender, channel};

use egui::Context;

/// Results on their way.
#[derive(Debug)]
pub struct Background<T> {
    sender: Sender<T>,
    receiver: Receiver<T>,
}

impl<T> Default for Background<T> {
    /// Nothing is under way.
    fn default() -> Self {
        let (sender, receiver) = channel();
        Self { sender, receiver }
    }
}

impl<T: Send + 'static> Background<T> {
    /// Starts a piece of work; the window is drawn again when it is done.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(&self, ctx: &Context, name: &str, work: impl FnOnce() -> T + Send + 'static) -> std::io::Result<()> {
        let (sender, ctx) = (self.sender.clone(), ctx.clone());
        std::thread::Builder::new().name(name.into()).spawn(move || {
            // The window may be gone by then; nobody else wants the result.
            let _ = sender.send(work());
            ctx.request_repaint();
        })?;
        Ok(())
    }

    /// A result, if there is one.
    pub fn poll(&self) -> Option<T> {
        self.receiver.try_recv().ok()
    }
}
