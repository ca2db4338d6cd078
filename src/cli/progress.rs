//! Progress bars, one stage after the other, on a terminal only.

use std::{io::IsTerminal, sync::Mutex, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};
use lumislice::{job::Progress, words::escaped};

/// Draws the current stage.
pub struct Bars {
    shown: bool,
    current: Mutex<ProgressBar>,
}

/// Steps a share is counted in.
const SHARE_STEPS: u64 = 1000;

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

    /// A stage that tells its share done, 0 to 1.
    pub fn share(&self, name: &str) -> impl FnMut(f64) + use<'_> {
        self.stage(name, SHARE_STEPS);
        let mut done = 0;
        move |share| {
            let now = (share.clamp(0.0, 1.0) * SHARE_STEPS as f64) as u64;
            self.advance(now.saturating_sub(done));
            done = done.max(now);
        }
    }
}

impl Progress for Bars {
    fn stage(&self, name: &str, total: u64) {
        if !self.shown {
            return;
        }
        // The last stage's line goes before the next one is drawn; the other way round, what is cleared is the new line.
        self.finish();
        let bar = if total == 0 { ProgressBar::new_spinner() } else { ProgressBar::new(total) };
        let template = match total {
            0 => "  {spinner} {msg:10} {elapsed}",
            SHARE_STEPS => "  {msg:10} [{bar:40}] {percent}%  {eta} left",
            _ => "  {msg:10} [{bar:40}] {pos}/{len}  {eta} left",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
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
}

impl lumislice::watch::Watch for Bars {
    fn stage(&self, name: &str, steps: u64) {
        Progress::stage(self, name, steps);
    }

    fn advance(&self, steps: u64) {
        Progress::advance(self, steps);
    }

    fn stop_requested(&self) -> bool {
        super::INTERRUPT.requested()
    }
}
