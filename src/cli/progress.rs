//! The watch of every command: progress bars, one stage after the other, on a terminal; elsewhere a line for a stage
//! that takes long; and Ctrl-C.

use std::{
    fmt::Write,
    io::IsTerminal,
    sync::Mutex,
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use lumislice::{
    watch::{Thousandths, Watch},
    words::escaped,
};

use super::INTERRUPT;

/// Draws the current stage, and stops for Ctrl-C.
pub struct Bars {
    shown: bool,
    quiet: bool,
    current: Mutex<ProgressBar>,
    line: Mutex<Option<Line>>,
}

/// A stage that no bar is drawn of.
struct Line {
    name: String,
    steps: u64,
    done: u64,
    began: Instant,
    told: bool,
}

/// How long a stage lasts before the time that it will take is told.
const TOLD_AFTER: Duration = Duration::from_secs(1);
/// How long one lasts before it gets a line where no bars are drawn.
const LONG: Duration = Duration::from_secs(10);

impl Line {
    /// What to say now that a stage has gone on for `elapsed`: once, and of one that takes long.
    fn told(&mut self, elapsed: Duration) -> Option<String> {
        if self.told || elapsed < LONG || self.done == 0 || self.done >= self.steps {
            return None;
        }
        self.told = true;
        let left = elapsed.mul_f64((self.steps - self.done) as f64 / self.done as f64);
        Some(format!("{}: {:#} left", self.name, HumanDuration(left)))
    }
}

impl Bars {
    /// Bars on a terminal, lines for what takes long elsewhere; nothing when `quiet`.
    pub fn new(quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        Self { shown, quiet, current: Mutex::new(ProgressBar::hidden()), line: Mutex::new(None) }
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
            if let Ok(mut line) = self.line.lock() {
                *line = Some(Line { name: name.to_owned(), steps, done: 0, began: Instant::now(), told: false });
            }
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
        if !self.shown && !self.quiet {
            let told = self.line.lock().ok().and_then(|mut line| {
                let line = line.as_mut()?;
                line.done += steps;
                line.told(line.began.elapsed())
            });
            if let Some(told) = told {
                super::say(&told);
            }
        }
        if let Ok(current) = self.current.lock() {
            current.inc(steps);
        }
    }

    fn stop_requested(&self) -> bool {
        INTERRUPT.requested()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_stages_are_told_once() {
        let mut line = Line { name: "light".to_owned(), steps: 400, done: 0, began: Instant::now(), told: false };
        assert_eq!(line.told(LONG * 2), None);
        line.done = 100;
        assert_eq!(line.told(LONG / 2), None);
        assert_eq!(line.told(LONG), Some("light: 30s left".to_owned()));
        assert_eq!(line.told(LONG), None);
    }
}
