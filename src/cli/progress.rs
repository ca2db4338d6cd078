//! Progress bars, one stage after the other, on a terminal only.

use std::{io::IsTerminal, sync::Mutex, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};
use lumislice::job::Progress;

/// Draws the current stage.
pub struct Bars {
    shown: bool,
    current: Mutex<ProgressBar>,
}

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

impl Progress for Bars {
    fn stage(&self, name: &str, total: u64) {
        if !self.shown {
            return;
        }
        let bar = if total == 0 { ProgressBar::new_spinner() } else { ProgressBar::new(total) };
        let template = match total {
            0 => "{spinner} {msg:10} {elapsed}",
            _ => "  {msg:10} [{bar:40}] {pos}/{len}  {eta} left",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(name.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        self.replace(bar);
    }

    fn advance(&self, steps: u64) {
        if let Ok(current) = self.current.lock() {
            current.inc(steps);
        }
    }
}
