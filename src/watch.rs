//! How slow work tells what it is doing, and how it is told to stop.
//!
//! Every call of this crate that may take seconds takes one `&dyn `[`Watch`]. It opens stages and advances through
//! their steps, and asks between batches of work whether to go on; asked to stop, it ends with [`Stopped`], which every
//! room's error holds. A call whose documentation names no stage opens none, and advances through the one its caller
//! opened.
//!
//! ```
//! use lumislice::watch::Watch;
//!
//! /// Tells every stage on standard error.
//! struct Stages;
//!
//! impl Watch for Stages {
//!     fn stage(&self, name: &str, _steps: u64) {
//!         eprintln!("{name}");
//!     }
//! }
//! ```

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Watches over slow work. All methods may be called from any thread, and do nothing unless implemented.
pub trait Watch: Sync {
    /// A stage begins, and the one before it is over; `steps` is how many steps it has, 0 if that is unknown.
    fn stage(&self, _name: &str, _steps: u64) {}

    /// A stage begins as by [`Self::stage`], whose steps count nothing: they are thousandths of it.
    fn stage_of_thousandths(&self, name: &str) {
        self.stage(name, Thousandths::STEPS);
    }

    /// Steps of the current stage are done.
    fn advance(&self, _steps: u64) {}

    /// Something is known before the work is over: a `"warning"` (`kind`, `text`, and where there are such `object` and
    /// `cure`), or a `"round"` of correction. `details` is an object with the names that docs/events.md has.
    fn found(&self, _what: &'static str, _details: serde_json::Value) {}

    /// Whether the work should end; asked between batches, and true from then on.
    fn stop_requested(&self) -> bool {
        false
    }

    /// What work calls between batches.
    ///
    /// # Errors
    /// [`Stopped`] once a stop is requested.
    fn go_on(&self) -> Result<(), Stopped> {
        if self.stop_requested() { Err(Stopped) } else { Ok(()) }
    }
}

/// The work ended because its [`Watch`] asked for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Stopped;

/// Hears nothing and never asks to stop.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}

/// A request to stop, set from anywhere, such as a signal handler. By itself it is a watch that hears nothing.
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

    /// Whether a stop was asked for.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Watch for Interrupt {
    fn stop_requested(&self) -> bool {
        self.requested()
    }
}

/// Passes on the request to stop, and hears nothing: for work that is one step of its caller's stage.
pub struct StopOnly<'a>(pub &'a dyn Watch);

impl Watch for StopOnly<'_> {
    fn stop_requested(&self) -> bool {
        self.0.stop_requested()
    }
}

/// One stage of [`Thousandths::STEPS`] steps over work that is counted finer, such as photons, and may be several
/// calls.
pub struct Thousandths<'a> {
    watch: &'a dyn Watch,
    whole: u64,
    done: AtomicU64,
}

impl<'a> Thousandths<'a> {
    /// Steps of the stage.
    pub const STEPS: u64 = 1000;

    /// Opens the stage; `whole` is what all calls together will advance by.
    pub fn begin(watch: &'a dyn Watch, name: &str, whole: u64) -> Self {
        watch.stage_of_thousandths(name);
        Self { watch, whole: whole.max(1), done: AtomicU64::new(0) }
    }

    fn steps(&self, done: u64) -> u64 {
        (u128::from(done.min(self.whole)) * u128::from(Self::STEPS) / u128::from(self.whole)) as u64
    }
}

impl Watch for Thousandths<'_> {
    fn advance(&self, steps: u64) {
        let before = self.done.fetch_add(steps, Ordering::Relaxed);
        let passed = self.steps(before.saturating_add(steps)) - self.steps(before);
        if passed > 0 {
            self.watch.advance(passed);
        }
    }

    fn stop_requested(&self) -> bool {
        self.watch.stop_requested()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Default)]
    struct Heard(Mutex<Vec<String>>);

    impl Watch for Heard {
        fn stage(&self, name: &str, steps: u64) {
            self.0.lock().unwrap().push(format!("{name} {steps}"));
        }

        fn advance(&self, steps: u64) {
            self.0.lock().unwrap().push(steps.to_string());
        }
    }

    #[test]
    fn thousandths_add_up_whatever_the_steps() {
        let heard = Heard::default();
        let stage = Thousandths::begin(&heard, "photons", 3_000_001);
        // One call's stages are not the whole's.
        stage.stage("inner", 5);
        [1, 999, 1_499_000, 1_500_001].into_iter().for_each(|steps| stage.advance(steps));
        stage.advance(10);
        assert_eq!(heard.0.into_inner().unwrap(), ["photons 1000", "499", "501"]);
    }

    #[test]
    fn a_stage_of_nothing_is_done_at_once() {
        let heard = Heard::default();
        Thousandths::begin(&heard, "nothing", 0).advance(1);
        assert_eq!(heard.0.into_inner().unwrap(), ["nothing 1000", "1000"]);
    }

    #[test]
    fn a_request_to_stop_passes_through() {
        let interrupt = Interrupt::new();
        let stage = Thousandths::begin(&interrupt, "slow", 10);
        let quiet = StopOnly(&stage);
        assert_eq!((quiet.go_on(), Unwatched.go_on()), (Ok(()), Ok(())));
        interrupt.request();
        assert_eq!(quiet.go_on(), Err(Stopped));
    }
}
