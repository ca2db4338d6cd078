//! Who is to blame when something fails, and what would help: all that a program needs to choose its exit code and its
//! advice.
//!
//! Every public error of this crate says so by [`Blamed`], an error that holds another one mostly as that one does.

use std::error::Error;

use crate::watch::Stopped;

/// Who is to blame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blame {
    /// What was asked for, or a file that was read.
    Input,
    /// The disk: there was no writing what was asked for.
    Disk,
    /// Whoever watched the work and asked it to stop.
    Interrupt,
}

/// What would help, as far as one call can tell: another choice of [`Existing`](crate::output::Existing).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// To replace what lies in the output folder.
    Overwrite,
    /// To go on where the same job was interrupted.
    Resume,
    /// Either.
    OverwriteOrResume,
}

/// An error that tells who is to blame.
pub trait Blamed: Error {
    /// Who is to blame; the input, unless the error says otherwise.
    fn blame(&self) -> Blame {
        Blame::Input
    }

    /// What would help, if anything here would.
    fn remedy(&self) -> Option<Remedy> {
        None
    }
}

/// An error and its causes on one line. Some of our messages quote their cause, others leave it to the chain: none is
/// said twice. What was stopped says so itself.
pub fn one_line(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        if !cause.is::<Stopped>() && !text.contains(&words) {
            text += ": ";
            text += &words;
        }
        next = cause.source();
    }
    text
}

impl Blamed for Stopped {
    fn blame(&self) -> Blame {
        Blame::Interrupt
    }
}
