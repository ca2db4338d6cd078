//! How a run tells what it is doing, and how it is told to stop.

use std::sync::atomic::{AtomicBool, Ordering};

/// Listens to a run. All methods may be called from any thread.
pub trait Progress: Sync {
    /// A stage begins; `total` is how many steps it has, 0 if that is unknown.
    fn stage(&self, name: &str, total: u64);
    /// Steps of the current stage are done.
    fn advance(&self, steps: u64);
}

/// Tells nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _name: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}

/// A request to stop: the run ends at the next step, leaving only whole files behind.
#[derive(Debug, Default)]
pub struct Interrupt(AtomicBool);

impl Interrupt {
    /// No request yet.
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Asks to stop.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
