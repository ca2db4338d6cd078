//! Events for programs that wait: one JSON object a line on stderr, as docs/events.md has them.
//!
//! The first line is `started`, the last one `finished`; stages are told by a [`Watch`](lumislice::watch::Watch).

use std::{
    collections::BTreeSet,
    io::{self, Write},
    sync::{Mutex, MutexGuard},
    time::{Duration, Instant},
};

use serde_json::{Map, Value, json};

use super::progress::{Pace, Steps};

/// Version of the events: it grows when what one says means another thing, or is there no more.
pub const VERSION: u32 = 1;
/// The kind of a warning that has none of its own.
pub const OTHER: &str = "other";

/// How long steps are counted before the time that is left follows from them.
const PACED_AFTER: Duration = Duration::from_secs(2);
/// Longest silence of a stage: who waits is told that it goes on.
const SILENCE: Duration = Duration::from_secs(10);

/// Writes events to stderr.
pub struct Events {
    began: Instant,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    stage: Option<Stage>,
    stages: u64,
    /// Warnings that were told.
    warned: BTreeSet<String>,
    result: Value,
    reason: Option<String>,
    finished: bool,
}

struct Stage {
    number: u64,
    name: String,
    pace: Pace,
    /// Steps that were told as done, and when.
    told: (u64, Instant),
}

impl Stage {
    /// What every event of a stage has.
    fn named(&self) -> Map<String, Value> {
        Map::from_iter([("stage".to_owned(), self.number.into()), ("name".to_owned(), self.name.as_str().into())])
    }

    /// Steps as they are told: only where they count something.
    fn counted(&self, steps: u64) -> Option<u64> {
        matches!(self.pace.steps, Steps::Counted(_)).then_some(steps)
    }

    fn progress(&self, now: Instant) -> Value {
        let (steps, done) = (self.pace.steps.all(), self.pace.done);
        let fraction = (steps > 0).then(|| rounded((done as f64 / steps as f64).min(1.0)));
        let mut event = self.named();
        event.insert("steps".to_owned(), self.counted(steps).into());
        event.insert("done".to_owned(), self.counted(done).into());
        event.insert("fraction".to_owned(), fraction.into());
        event.insert("stage_s".to_owned(), seconds(now - self.pace.began).into());
        event.insert("left_s".to_owned(), self.pace.left(now, PACED_AFTER).map(seconds).into());
        event.into()
    }
}

/// To a thousandth.
fn rounded(value: f64) -> f64 {
    (1000.0 * value).round() / 1000.0
}

fn seconds(time: Duration) -> f64 {
    rounded(time.as_secs_f64())
}

impl Events {
    /// Tells that `command` begins.
    pub fn begin(command: Option<&str>) -> Self {
        let events = Self { began: Instant::now(), state: Mutex::default() };
        let program = concat!("lumislice ", env!("CARGO_PKG_VERSION"));
        let started = json!({ "version": VERSION, "program": program, "command": command });
        events.write(&events.state(), "started", started);
        events
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Writes a line, unless the last one was written. Who does not listen is no reason to end.
    fn write(&self, state: &State, event: &str, fields: Value) {
        if state.finished {
            return;
        }
        let mut line = Map::new();
        line.insert("event".to_owned(), event.into());
        line.insert("elapsed_s".to_owned(), seconds(self.began.elapsed()).into());
        if let Value::Object(fields) = fields {
            line.extend(fields);
        }
        let _ = io::stderr().lock().write_all(format!("{}\n", Value::from(line)).as_bytes());
    }

    /// Tells an event.
    pub fn tell(&self, event: &str, fields: Value) {
        self.write(&self.state(), event, fields);
    }

    /// A stage begins, and the one before it is over; `ahead` is what is known to follow.
    pub fn stage(&self, name: &str, steps: Steps, ahead: &[&str]) {
        let mut state = self.state();
        self.end_stage_of(&mut state);
        state.stages += 1;
        let now = Instant::now();
        let stage = Stage { number: state.stages, name: name.to_owned(), pace: Pace::new(steps, now), told: (0, now) };
        let mut event = stage.named();
        event.insert("steps".to_owned(), stage.counted(steps.all()).into());
        event.insert("ahead".to_owned(), json!(ahead));
        state.stage = Some(stage);
        self.write(&state, "stage", event.into());
    }

    /// Steps of the stage are done.
    pub fn advance(&self, steps: u64) {
        if let Some(stage) = &mut self.state().stage {
            stage.pace.advance(steps, Instant::now());
        }
    }

    /// Tells how far the stage is, where that is news; asked once in a while.
    pub fn tick(&self) {
        let mut state = self.state();
        let now = Instant::now();
        if let Some(stage) = &mut state.stage
            && (stage.told.0 != stage.pace.done || now - stage.told.1 >= SILENCE)
        {
            stage.told = (stage.pace.done, now);
            let event = stage.progress(now);
            self.write(&state, "progress", event);
        }
    }

    /// The stage is over, if there is one.
    pub fn end_stage(&self) {
        self.end_stage_of(&mut self.state());
    }

    fn end_stage_of(&self, state: &mut State) {
        if let Some(stage) = state.stage.take() {
            let mut event = stage.named();
            event.insert("stage_s".to_owned(), seconds(stage.pace.began.elapsed()).into());
            self.write(state, "stage-ended", event.into());
        }
    }

    /// Tells a warning, once: what is found on the way stands in the documents again.
    pub fn warning(&self, warning: Value) {
        let text = warning["text"].as_str().unwrap_or_default().to_owned();
        let mut state = self.state();
        if state.warned.insert(text) {
            self.write(&state, "warning", warning);
        }
    }

    /// Tells why there will be no result.
    pub fn error(&self, kind: &str, text: &str, exit_code: u8) {
        self.error_of(&mut self.state(), kind, text, exit_code);
    }

    fn error_of(&self, state: &mut State, kind: &str, text: &str, exit_code: u8) {
        self.end_stage_of(state);
        self.write(state, "error", json!({ "kind": kind, "text": text, "exit_code": exit_code }));
    }

    /// Keeps the result for the last event.
    pub fn set_result(&self, result: Value) {
        self.state().result = result;
    }

    /// Keeps why the answer is no for the last event.
    pub fn set_reason(&self, reason: &str) {
        self.state().reason = Some(reason.to_owned());
    }

    /// Tells an error and the end, and nothing of other threads between them.
    pub fn failed(&self, kind: &str, text: &str, exit_code: u8, outcome: &str) {
        let mut state = self.state();
        self.error_of(&mut state, kind, text, exit_code);
        self.finish(&mut state, exit_code, outcome);
    }

    /// Tells the end, after which nothing is told. `failure` is the outcome where it is neither yes nor no.
    pub fn finished(&self, exit_code: u8, failure: Option<&str>) {
        let outcome = failure.unwrap_or(match exit_code {
            0 => "done",
            1 => "no",
            _ => "failed",
        });
        self.finish(&mut self.state(), exit_code, outcome);
    }

    fn finish(&self, state: &mut State, exit_code: u8, outcome: &str) {
        self.end_stage_of(state);
        let mut event = json!({ "exit_code": exit_code, "outcome": outcome });
        if let Some(reason) = state.reason.take() {
            event["reason"] = reason.into();
        }
        event["result"] = state.result.take();
        self.write(state, "finished", event);
        state.finished = true;
    }
}

#[cfg(test)]
mod tests {
    use lumislice::watch::Thousandths;

    use super::*;

    fn stage(steps: Steps, began: Instant) -> Stage {
        Stage { number: 1, name: "slices".to_owned(), pace: Pace::new(steps, began), told: (0, began) }
    }

    #[test]
    fn the_time_left_is_told_from_the_third_second_of_counted_steps() {
        let began = Instant::now();
        let after = |seconds: f64| began + Duration::from_secs_f64(seconds);
        let mut stage = stage(Steps::Counted(60), began);
        assert_eq!(stage.progress(after(5.0))["left_s"], Value::Null);
        stage.pace.advance(10, after(6.0));
        stage.pace.advance(20, after(7.0));
        let early = stage.progress(after(7.9));
        assert_eq!((&early["left_s"], early["fraction"].as_f64()), (&Value::Null, Some(0.5)));
        let later = stage.progress(after(8.0));
        assert_eq!((later["left_s"].as_f64(), later["stage_s"].as_f64()), (Some(3.0), Some(8.0)));
        stage.pace.advance(30, after(9.0));
        assert_eq!(stage.progress(after(9.0))["left_s"], Value::Null);
    }

    #[test]
    fn a_thousand_steps_are_counted_and_thousandths_are_not() {
        let now = Instant::now();
        let told = |steps: Steps| {
            let mut stage = stage(steps, now);
            stage.pace.advance(250, now);
            let event = stage.progress(now);
            [
                event["steps"].as_u64(),
                event["done"].as_u64(),
                event["fraction"].as_f64().map(|part| (100.0 * part) as u64),
            ]
        };
        assert_eq!(told(Steps::of(Thousandths::STEPS)), [Some(1000), Some(250), Some(25)]);
        assert_eq!(told(Steps::Thousandths), [None, None, Some(25)]);
        assert_eq!(told(Steps::of(0)), [None; 3]);
    }
}
