//! Slow work with Python's own lock released: progress is told, and Ctrl-C heard, from the thread that called.

use std::{
    sync::{
        Condvar, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use lumislice::{
    blame::{Blame, Blamed, one_line},
    watch::{Interrupt, Watch},
};
use pyo3::{
    create_exception,
    exceptions::{PyKeyboardInterrupt, PyOSError, PyValueError},
    prelude::*,
};

create_exception!(lumislice, InputError, PyValueError, "What was asked for, or a file that was read, cannot be used.");

/// How often progress is told and signals are looked for.
const TICK: Duration = Duration::from_millis(50);

/// What the working thread tells.
#[derive(Default)]
struct Told {
    interrupt: Interrupt,
    done: AtomicU64,
    stage: Mutex<(String, u64)>,
    over: Mutex<bool>,
    bell: Condvar,
}

impl Watch for Told {
    fn stage(&self, name: &str, steps: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = (name.to_owned(), steps);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn stop_requested(&self) -> bool {
        self.interrupt.requested()
    }
}

impl Told {
    /// Waits for the end, at most a tick; whether it has come.
    fn wait(&self) -> bool {
        let over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.bell.wait_timeout_while(over, TICK, |over| !*over);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }

    fn ring(&self) {
        *self.over.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.bell.notify_all();
    }

    /// Calls `progress` if something has changed since it was called last.
    fn tell(&self, py: Python<'_>, progress: Option<&Py<PyAny>>, last: &mut (String, u64)) -> PyResult<()> {
        let Some(progress) = progress else { return Ok(()) };
        let (stage, steps) = self.stage.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let now = (stage, self.done.load(Ordering::Relaxed));
        if now != *last && !now.0.is_empty() {
            progress.call1(py, (now.0.as_str(), now.1, steps))?;
            *last = now;
        }
        Ok(())
    }
}

/// Rings when dropped, so that a panic is heard too.
struct Ring<'a>(&'a Told);

impl Drop for Ring<'_> {
    fn drop(&mut self) {
        self.0.ring();
    }
}

/// An error as Python raises it, in the words of the command line.
pub fn raised<E: Blamed>(error: &E) -> PyErr {
    let words = one_line(error);
    match error.blame() {
        Blame::Input => InputError::new_err(words),
        Blame::Disk => PyOSError::new_err(words),
        Blame::Interrupt => PyKeyboardInterrupt::new_err(words),
    }
}

/// Does `work` in a thread of its own. An exception in `progress`, or Ctrl-C, stops it and is raised when it has ended.
pub fn watched<T: Send, E: Blamed + Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Watch) -> Result<T, E> + Send,
) -> PyResult<T> {
    let told = Told::default();
    std::thread::scope(|scope| {
        let working = scope.spawn(|| {
            let _ring = Ring(&told);
            work(&told)
        });
        let mut raised_meanwhile = None;
        let mut last = (String::new(), u64::MAX);
        loop {
            let over = py.detach(|| told.wait());
            if raised_meanwhile.is_none() {
                let heard = py.check_signals().and_then(|()| told.tell(py, progress.as_ref(), &mut last));
                if let Err(error) = heard {
                    told.interrupt.request();
                    raised_meanwhile = Some(error);
                }
            }
            if over {
                break;
            }
        }
        let result = py.detach(|| working.join());
        match (raised_meanwhile, result) {
            (Some(error), _) => Err(error),
            (None, Ok(result)) => result.map_err(|error| raised(&error)),
            (None, Err(panic)) => std::panic::resume_unwind(panic),
        }
    })
}
