//! What a command fails with: words for stderr, and an exit code from who is to blame.

use std::{fmt::Display, io};

use lumislice::blame::{Blame, Blamed, Remedy, one_line};

/// Exit code after Ctrl-C, as shells have it.
pub const INTERRUPTED: u8 = 130;

/// Why a command was not done.
#[derive(Debug)]
pub struct Failure {
    blame: Blame,
    text: String,
}

/// A failure by what was asked for, worded as by `format!`.
macro_rules! refusal {
    ($($words:tt)*) => { $crate::cli::failure::Failure::refusal(format!($($words)*)) };
}

/// Returns a [`refusal!`].
macro_rules! refuse {
    ($($words:tt)*) => { return Err($crate::cli::failure::refusal!($($words)*)) };
}

pub(super) use {refusal, refuse};

impl Failure {
    /// What was asked for cannot be done.
    pub fn refusal(text: String) -> Self {
        Self { blame: Blame::Input, text }
    }

    /// Somebody asked to stop.
    pub fn interrupted(text: &str) -> Self {
        Self { blame: Blame::Interrupt, text: text.to_owned() }
    }

    /// A call that failed before anything was written: where it was asked to stop there is nothing to go on with.
    pub fn before_writing(error: impl Blamed) -> Self {
        match error.blame() {
            Blame::Interrupt => Self::interrupted("interrupted; nothing was written"),
            _ => error.into(),
        }
    }

    /// `place` cannot be written.
    pub fn writing(place: impl Display, error: io::Error) -> Self {
        Self { blame: Blame::Disk, text: format!("{place}: writing failed: {error}") }
    }

    /// The words, which may hold anything that a file name holds.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Who or what it is by, as events name it.
    pub fn kind(&self) -> &'static str {
        match self.blame {
            Blame::Input => "input",
            Blame::Disk => "disk",
            Blame::Interrupt => "interrupt",
        }
    }

    /// What it makes of the command, as events name it.
    pub fn outcome(&self) -> &'static str {
        if self.blame == Blame::Interrupt { "interrupted" } else { "failed" }
    }

    /// The exit code.
    pub fn exit_code(&self) -> u8 {
        match self.blame {
            Blame::Input => 2,
            Blame::Disk => 3,
            Blame::Interrupt => INTERRUPTED,
        }
    }
}

impl<E: Blamed> From<E> for Failure {
    fn from(error: E) -> Self {
        let advice = match error.remedy() {
            None => "",
            Some(Remedy::Overwrite) => " (--overwrite replaces it)",
            Some(Remedy::Resume) => ", and --resume goes on from there",
            Some(Remedy::OverwriteOrResume) => {
                " (--overwrite replaces files written earlier, slice --resume goes on with an interrupted job)"
            }
        };
        Self { blame: error.blame(), text: one_line(&error) + advice }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use lumislice::{
        appearance::bssrdf::BssrdfError, job::RunError, job::compare::CompareError, job::factor::FactorError,
        job::verify::VerifyError, measure::MeasureError, optics::OpticsError, output::OutputError, watch::Stopped,
    };

    use super::*;

    fn says(error: impl Blamed, code: u8, text: &str) {
        let failure = Failure::from(error);
        assert_eq!((failure.text(), failure.exit_code()), (text, code));
    }

    fn full() -> io::Error {
        io::ErrorKind::StorageFull.into()
    }

    #[test]
    fn folders_that_are_taken_come_with_advice() {
        let taken = || OutputError::NotEmpty { path: PathBuf::from("out") };
        let text = "out: found a folder that is not empty, expected a new or empty one (--overwrite replaces files \
                    written earlier, slice --resume goes on with an interrupted job)";
        says(RunError::from(taken()), 2, text);
        says(FactorError::from(taken()), 2, text);
        says(CompareError::from(taken()), 2, text);
        let (path, found, expected) = (PathBuf::from("j"), "slices 0..5".to_owned(), "0..9".to_owned());
        let text = "j: found slices 0..5, expected 0..9: what was begun there is another job (--overwrite replaces it)";
        says(RunError::from(OutputError::AnotherJob { path, found, expected }), 2, text);
    }

    #[test]
    fn who_asked_to_stop_is_told_once() {
        says(
            RunError::from(Stopped),
            INTERRUPTED,
            "interrupted; files written so far are whole, and --resume goes on from there",
        );
        let early = Failure::before_writing(RunError::from(Stopped));
        assert_eq!((early.text(), early.exit_code()), ("interrupted; nothing was written", INTERRUPTED));
        says(OpticsError::from(Stopped), INTERRUPTED, "simulation cancelled");
        says(CompareError::from(OpticsError::from(Stopped)), INTERRUPTED, "simulation cancelled");
        says(MeasureError::from(Stopped), INTERRUPTED, "measurement cancelled");
        says(MeasureError::from(OpticsError::from(Stopped)), INTERRUPTED, "simulation cancelled");
        says(VerifyError::from(Stopped), INTERRUPTED, "interrupted before everything was checked");
        says(FactorError::from(BssrdfError::from(Stopped)), INTERRUPTED, "interrupted");
    }

    #[test]
    fn a_full_disk_is_not_the_input() {
        let write = || OutputError::Io { action: "writing", path: "out/a".into(), source: full() };
        let text = format!("out/a: writing failed: {}", full());
        says(RunError::from(write()), 3, &text);
        says(FactorError::from(write()), 3, &text);
        let scratch = || BssrdfError::Scratch { folder: "/tmp".into(), source: full() };
        let text = format!("/tmp: writing a working copy failed: {}", full());
        says(FactorError::from(scratch()), 3, &text);
        says(CompareError::from(scratch()), 3, &text);
        let read = OpticsError::File { file: "m.toml".into(), source: io::ErrorKind::NotFound.into() };
        says(RunError::from(read), 2, "m.toml: entity not found");
        assert_eq!(Failure::writing("stdout", full()).exit_code(), 3);
    }
}
