//! The watch of every command: progress bars, one stage after the other, on a terminal only; and Ctrl-C.

use std::{fmt::Write, io::IsTerminal, sync::Mutex, time::Duration};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use lumislice::{
    watch::{Thousandths, Watch},
    words::escaped,
};

use super::INTERRUPT;

/// Draws the current stage, and stops for Ctrl-C.
pub struct Bars {
    shown: bool,
    current: Mutex<ProgressBar>,
}

/// How long a stage lasts before the time that it will take is told.
const TOLD_AFTER: Duration = Duration::from_secs(1);

impl Bars {
    /// Bars on a terminal, nothing elsewhere or when `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { shown: !quiet && std::io::stderr().is_terminal(), current: Mutex::new(ProgressBar::hidden()) }
    }

    fn replace(&self, bar: ProgressBar) {
        if let Ok(mut current) = self.current.lock() {
            current.finish_and_clear();
            *current = bar;
        }
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        self.replace(ProgressBar::hidden());
    }
}

impl Watch for Bars {
    fn stage(&self, name: &str, steps: u64) {
        if !self.shown {
            return;
        }
        // The last stage's line goes before the next one is drawn; the other way round, what is cleared is the new
        // line.
        self.finish();
        let bar = if steps == 0 { ProgressBar::new_spinner() } else { ProgressBar::new(steps) };
        let template = match steps {
            0 => "  {spinner} {msg:21} {elapsed}",
            Thousandths::STEPS => "  {msg:21} [{bar:24}] {percent}%{left}",
            _ => "  {msg:21} [{bar:24}] {pos}/{len}{left}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            let left = |state: &ProgressState, out: &mut dyn Write| {
                // Of nothing done nothing follows.
                if state.pos() > 0 && state.elapsed() >= TOLD_AFTER {
                    let _ = write!(out, "  {:#} left", HumanDuration(state.eta()));
                }
            };
            bar.set_style(style.progress_chars("=> ").with_key("left", left));
        }
        bar.set_message(escaped(name));
        bar.enable_steady_tick(Duration::from_millis(200));
        self.replace(bar);
    }

    fn advance(&self, steps: u64) {
        if let Ok(current) = self.current.lock() {
            current.inc(steps);
        }
    }

    fn stop_requested(&self) -> bool {
        INTERRUPT.requested()
    }
}
