//! Words for whoever waits, on stderr: lines, or events where `--progress json` asks for them.

use std::{
    io::{self, IsTerminal, Write},
    sync::{Mutex, MutexGuard, OnceLock, PoisonError},
};

use clap::ValueEnum;
use lumislice::words::escaped;
use serde_json::json;

use super::{
    Result, WIDTH,
    events::{Events, OTHER},
    failure::Failure,
    print_json,
    table::wrapped,
};

/// How progress is told on stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Progress {
    /// Bars on a terminal, else as `plain`; nothing beside --json.
    #[default]
    Auto,
    /// A line for a stage that takes long.
    Plain,
    /// Nothing but warnings, notes and errors.
    None,
    /// All that is told, one JSON object a line: docs/events.md.
    Json,
}

static PROGRESS: OnceLock<Progress> = OnceLock::new();
static EVENTS: OnceLock<Events> = OnceLock::new();

impl Progress {
    /// What the arguments ask for, whether the rest of them can be read or not.
    pub fn of_arguments(arguments: impl Iterator<Item = std::ffi::OsString>) -> Self {
        let words: Vec<_> = arguments.take_while(|word| word != "--").collect();
        let pairs = words.iter().zip(words.iter().skip(1).map(Some).chain([None]));
        let asked = pairs.filter_map(|(word, next)| match word.to_str()?.strip_prefix("--progress")? {
            "" => next?.to_str(),
            value => value.strip_prefix('='),
        });
        asked.last().and_then(|value| Self::from_str(value, false).ok()).unwrap_or_default()
    }

    /// Holds for the rest of the process, which carries out `command` if the arguments name one.
    pub fn begin(self, command: Option<&str>) {
        let _ = PROGRESS.set(self);
        if self == Self::Json {
            EVENTS.get_or_init(|| Events::begin(command));
            std::panic::set_hook(Box::new(|panic| *kept() = panic.to_string()));
        }
    }

    /// What was asked for.
    pub fn asked() -> Self {
        PROGRESS.get().copied().unwrap_or_default()
    }
}

/// Exit code of a panic.
pub const PANICKED: u8 = 101;
/// What the last panic said. Some are caught, and one that tells events must not tell of itself: it is told of in the
/// end, if it was the end.
static PANIC: Mutex<String> = Mutex::new(String::new());

fn kept() -> MutexGuard<'static, String> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Tells what the command panicked with.
pub fn tell_panic(events: &Events) {
    events.failed("bug", &kept(), PANICKED, "failed");
}

/// Where events go, if they are asked for.
pub fn events() -> Option<&'static Events> {
    EVENTS.get()
}

/// Writes words to stderr: one line, but broken between words on a terminal.
fn line(text: &str) {
    let text = escaped(text);
    let text = if io::stderr().is_terminal() { styled(&wrapped(&text, WIDTH)) } else { text };
    let _ = writeln!(io::stderr(), "{text}");
}

/// What lines begin with, and how it is drawn on a terminal: as arguments' errors have it.
const KINDS: [(&str, &str); 4] =
    [("error:", "\x1b[1;31m"), ("warning:", "\x1b[1;33m"), ("note:", "\x1b[1m"), ("no:", "\x1b[1m")];

/// Text for a terminal, with the word it begins with in colour, unless the environment has `NO_COLOR` or a terminal that
/// knows none.
pub fn styled(text: &str) -> String {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let plain = set("NO_COLOR").is_some() || set("TERM").is_some_and(|terminal| terminal == "dumb");
    let kind = KINDS.iter().find(|(kind, _)| text.starts_with(kind)).filter(|_| !plain);
    kind.map_or(text.to_owned(), |(kind, colour)| format!("{colour}{kind}\x1b[0m{}", &text[kind.len()..]))
}

/// Tells something in passing, in a line of its own.
pub fn say(text: &str) {
    match events() {
        Some(events) => events.tell("note", json!({ "text": text })),
        None => line(text),
    }
}

/// Tells what is good to know.
pub fn note(text: &str) {
    match events() {
        Some(events) => events.tell("note", json!({ "text": text })),
        None => line(&format!("note: {text}")),
    }
}

/// Tells what the user should look at.
pub fn warn(text: &str) {
    match events() {
        Some(events) => events.warning(json!({ "kind": OTHER, "text": text })),
        None => line(&format!("warning: {text}")),
    }
}

/// [`warn`] of each; as lines only where no document on stdout has them.
pub fn warn_of(warnings: &[String], in_document: bool) {
    if events().is_some() || !in_document {
        warnings.iter().for_each(|warning| warn(warning));
    }
}

/// Tells why the answer is no.
pub fn say_no(reason: &str) {
    match events() {
        Some(events) => events.set_reason(reason),
        None => line(&format!("no: {reason}")),
    }
}

/// Tells what a command failed with.
pub fn fail(failure: &Failure) {
    match events() {
        Some(events) => events.error(failure.kind(), failure.text(), failure.exit_code()),
        None => line(&format!("error: {}", failure.text())),
    }
}

/// Shows what a command found: as the document on stdout if that is `asked` for, and as the result among events.
/// Whether it was asked for.
pub fn document(asked: bool, found: &impl serde::Serialize) -> Result<bool> {
    if let Some(events) = events() {
        events.set_result(serde_json::to_value(found).unwrap_or_default());
    }
    if asked {
        print_json(found)?;
    }
    Ok(asked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_read_from_arguments_that_are_wrong_elsewhere() {
        let of = |text: &str| Progress::of_arguments(text.split(' ').map(Into::into));
        assert_eq!(of("lumislice slize --progress json"), Progress::Json);
        assert_eq!(of("lumislice --progress=json slice --colour"), Progress::Json);
        assert_eq!(of("lumislice slice a.toml --progress"), Progress::Auto);
        assert_eq!(of("lumislice slice --progress jsn"), Progress::Auto);
        assert_eq!(of("lumislice slice -- --progress json"), Progress::Auto);
    }
}
