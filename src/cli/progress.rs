//! The watch of every command: progress bars, one stage after the other, on a terminal; elsewhere a line for a stage
//! that takes long, or events; and Ctrl-C.

use std::{
    fmt::Write,
    io::IsTerminal,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use lumislice::{
    watch::{Thousandths, Watch},
    words::escaped,
};
use serde_json::Value;

use super::{
    INTERRUPT,
    events::Events,
    tell::{self, Progress},
};

/// Draws the current stage, and stops for Ctrl-C.
pub struct Bars {
    shown: bool,
    events: Option<&'static Events>,
    current: Mutex<ProgressBar>,
    line: Arc<Mutex<Lines>>,
}

/// What is told where no bars are drawn.
#[derive(Default)]
struct Lines {
    stage: Option<Line>,
    /// What is still to come: how its first stage's name begins, and words for it.
    ahead: Vec<(&'static str, String)>,
}

/// A stage that no bar is drawn of.
struct Line {
    name: String,
    pace: Pace,
    told: Told,
}

/// The steps of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Steps {
    /// How many is unknown.
    Unknown,
    /// So many.
    Counted(u64),
    /// Those of [`Thousandths`], which count nothing.
    Thousandths,
}

impl Steps {
    /// Of a stage that begins with so many, 0 where that is unknown.
    pub fn of(steps: u64) -> Self {
        if steps == 0 { Self::Unknown } else { Self::Counted(steps) }
    }

    /// All of them; 0 where that is unknown.
    pub fn all(self) -> u64 {
        match self {
            Self::Unknown => 0,
            Self::Counted(steps) => steps,
            Self::Thousandths => Thousandths::STEPS,
        }
    }
}

/// How fast the steps of a stage are done.
pub struct Pace {
    /// All steps.
    pub steps: Steps,
    /// Steps that are done.
    pub done: u64,
    /// When the stage began.
    pub began: Instant,
    /// When its first steps were done, and how many these were: what comes before them is no measure of the rest.
    paced: Option<(Instant, u64)>,
}

impl Pace {
    /// Of a stage that begins now.
    pub fn new(steps: Steps, now: Instant) -> Self {
        Self { steps, done: 0, began: now, paced: None }
    }

    /// Steps are done.
    pub fn advance(&mut self, steps: u64, now: Instant) {
        self.done += steps;
        self.paced = self.paced.or(Some((now, self.done)));
    }

    /// Time that is left, once steps were counted for `least`: workers finish their first steps together, and a pace
    /// needs a while.
    pub fn left(&self, now: Instant, least: Duration) -> Option<Duration> {
        let (steps, done) = (self.steps.all(), self.done);
        let (since, first) = self.paced.map(|(since, first)| (now.duration_since(since), first))?;
        (since >= least && first < done && done < steps)
            .then(|| since.mul_f64((steps - done) as f64 / (done - first) as f64))
    }
}

/// What was told of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    Nothing,
    HowFar,
    TimeLeft,
}

/// How long a stage lasts before the time that it will take is told.
const TOLD_AFTER: Duration = Duration::from_secs(1);
/// How long one lasts before it gets a line where no bars are drawn, or says so far how long it took where they are.
const LONG: Duration = Duration::from_secs(10);

impl Lines {
    /// A stage begins: what was ahead up to it is so no more.
    fn begin(&mut self, name: &str, steps: Steps) {
        if let Some(reached) = self.ahead.iter().position(|(stage, _)| name.starts_with(stage)) {
            self.ahead.drain(..=reached);
        }
        let pace = Pace::new(steps, Instant::now());
        self.stage = Some(Line { name: name.to_owned(), pace, told: Told::Nothing });
    }

    /// Words for what is still to come.
    fn ahead(&self) -> Vec<&str> {
        self.ahead.iter().map(|(_, words)| words.as_str()).collect()
    }

    /// What to say now.
    fn told(&mut self, now: Instant) -> Option<String> {
        let told = self.stage.as_mut()?.told(now)?;
        let ahead = self.ahead();
        Some(if ahead.is_empty() { told } else { format!("{told}; then {}", ahead.join(", ")) })
    }
}

impl Line {
    /// What to say of a stage that takes long: once how far it is, where that is all that is known, and once how long
    /// it will take.
    fn told(&mut self, now: Instant) -> Option<String> {
        let elapsed = now.duration_since(self.pace.began);
        if elapsed < LONG || self.told == Told::TimeLeft {
            return None;
        }
        let Self { name, pace, .. } = self;
        let Pace { steps, done, .. } = &*pace;
        if let Some(left) = pace.left(now, LONG) {
            self.told = Told::TimeLeft;
            return Some(format!("{name}: {:#} left", HumanDuration(left)));
        }
        if self.told == Told::HowFar || *done >= steps.all() && *steps != Steps::Unknown {
            return None;
        }
        self.told = Told::HowFar;
        let far = match *steps {
            Steps::Unknown => String::new(),
            Steps::Counted(steps) => format!("{done} of {steps} in "),
            Steps::Thousandths => format!("{}% in ", *done / 10),
        };
        Some(format!("{name}: {far}{:#} so far", HumanDuration(elapsed)))
    }
}

impl Bars {
    /// As the command line asks for it; by itself bars on a terminal, lines for what takes long elsewhere, and nothing
    /// when `quiet`.
    pub fn new(quiet: bool) -> Self {
        let progress = match Progress::asked() {
            Progress::Auto if quiet => Progress::None,
            progress => progress,
        };
        let shown = progress == Progress::Auto && std::io::stderr().is_terminal();
        let (line, events) = (Arc::default(), tell::events());
        if !shown && progress != Progress::None {
            tell(&line, events);
        }
        Self { shown, events, current: Mutex::new(ProgressBar::hidden()), line }
    }

    /// Says what follows as well, where lines are told: how the first stage of each begins, and words for it.
    pub fn followed_by(self, ahead: Vec<(&'static str, String)>) -> Self {
        if let Ok(mut line) = self.line.lock() {
            line.ahead = ahead;
        }
        self
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
        if let Ok(mut line) = self.line.lock() {
            line.stage = None;
        }
        if let Some(events) = self.events {
            events.end_stage();
        }
    }

    fn begin(&self, name: &str, steps: Steps) {
        if self.shown {
            return self.draw(name, steps);
        }
        if let Ok(mut line) = self.line.lock() {
            line.begin(name, steps);
            if let Some(events) = self.events {
                events.stage(name, steps, &line.ahead());
            }
        }
    }

    fn draw(&self, name: &str, steps: Steps) {
        // The last stage's line goes before the next one is drawn; the other way round, what is cleared is the new
        // line.
        self.finish();
        let bar = if steps == Steps::Unknown { ProgressBar::new_spinner() } else { ProgressBar::new(steps.all()) };
        let template = match steps {
            Steps::Unknown => "  {spinner} {msg:21} {elapsed}",
            Steps::Counted(_) => "  {msg:21} [{bar:24}] {pos}/{len}{left}",
            Steps::Thousandths => "  {msg:21} [{bar:24}] {percent}%{left}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            let left = |state: &ProgressState, out: &mut dyn Write| {
                // Of nothing done no time left follows.
                if state.pos() == 0 && state.elapsed() >= LONG {
                    let _ = write!(out, "  {:#} so far", HumanDuration(state.elapsed()));
                } else if state.pos() > 0 && state.elapsed() >= TOLD_AFTER {
                    let _ = write!(out, "  {:#} left", HumanDuration(state.eta()));
                }
            };
            bar.set_style(style.progress_chars("=> ").with_key("left", left));
        }
        bar.set_message(escaped(name));
        bar.enable_steady_tick(Duration::from_millis(200));
        self.replace(bar);
    }
}

/// Looks every second how far the stage is, as long as there is one, for a stage may say nothing for long.
fn tell(line: &Arc<Mutex<Lines>>, events: Option<&'static Events>) {
    let line = Arc::downgrade(line);
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let Some(line) = line.upgrade() else { return };
            if let Some(events) = events {
                events.tick();
                continue;
            }
            let told = line.lock().ok().and_then(|mut line| line.told(Instant::now()));
            if let Some(told) = told {
                tell::say(&told);
            }
        }
    });
}

impl Watch for Bars {
    fn stage(&self, name: &str, steps: u64) {
        self.begin(name, Steps::of(steps));
    }

    fn stage_of_thousandths(&self, name: &str) {
        self.begin(name, Steps::Thousandths);
    }

    fn advance(&self, steps: u64) {
        if let Some(line) = self.line.lock().ok().as_mut().and_then(|line| line.stage.as_mut()) {
            line.pace.advance(steps, Instant::now());
        }
        if let Some(events) = self.events {
            events.advance(steps);
        }
        if let Ok(current) = self.current.lock() {
            current.inc(steps);
        }
    }

    fn found(&self, what: &'static str, details: Value) {
        match (self.events, what) {
            (None, _) => {}
            (Some(events), "warning") => events.warning(details),
            (Some(events), _) => events.tell(what, details),
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
    fn long_stages_are_told_how_far_they_are_and_what_is_left() {
        let mut lines = Lines {
            ahead: vec![("stackings", "s".into()), ("round", "4 rounds".into()), ("slices", "slices".into())],
            ..Lines::default()
        };
        lines.begin("stackings", Steps::of(40));
        let began = lines.stage.as_ref().unwrap().pace.began;
        assert_eq!(lines.told(began + LONG / 2), None);
        assert_eq!(lines.told(began + LONG).unwrap(), "stackings: 0 of 40 in 10s so far; then 4 rounds, slices");
        assert_eq!(lines.told(began + LONG), None);
        // The first step took long, the others do not.
        lines.stage.as_mut().unwrap().pace.advance(1, began + 2 * LONG);
        assert_eq!(lines.told(began + 2 * LONG), None);
        lines.stage.as_mut().unwrap().pace.advance(3, began + 3 * LONG);
        assert_eq!(lines.told(began + 3 * LONG).unwrap(), "stackings: 2m left; then 4 rounds, slices");
        assert_eq!(lines.told(began + 4 * LONG), None);
        lines.begin("slices", Steps::of(0));
        let began = lines.stage.as_ref().unwrap().pace.began;
        assert_eq!(lines.told(began + LONG).unwrap(), "slices: 10s so far");
        lines.begin("light", Steps::Thousandths);
        lines.stage.as_mut().unwrap().pace.advance(Thousandths::STEPS, began);
        assert_eq!(lines.told(began + 2 * LONG), None);
    }
}
