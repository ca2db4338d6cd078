//! The command line: arguments in, words to stderr, data to stdout, an exit code out.
//!
//! Only this room prints. Exit codes: 0 done; 1 done, but the answer is no; 2 bad usage, job or input; 3 reading or writing
//! the output failed; 130 interrupted.

mod progress;
mod slice;

use std::{
    io::{self, Write},
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
};

use clap::{Parser, Subcommand};
use lumislice::job::{Blame, Interrupt, RunError};

/// Slices meshes into voxels of resin that scatter light as specified.
#[derive(Debug, Parser)]
#[command(name = "lumislice", version, about, max_term_width = 100, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Slice(slice::SliceArgs),
}

/// What a command ends with when nothing failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    /// Done.
    Yes,
    /// Done, but the answer is no.
    No,
}

/// Set by Ctrl-C, looked at by everything slow.
static INTERRUPT: Interrupt = Interrupt::new();

/// Runs the command line.
pub fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { 2 } else { 0 };
            // A closed pipe is no reason to fail twice.
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    install_interrupt();
    let result = match &cli.command {
        Command::Slice(args) => slice::run(args),
    };
    match result {
        Ok(Answer::Yes) => ExitCode::SUCCESS,
        Ok(Answer::No) => ExitCode::from(1),
        Err(error) => {
            let _ = writeln!(io::stderr(), "error: {error:#}");
            ExitCode::from(exit_code(&error))
        }
    }
}

fn exit_code(error: &anyhow::Error) -> u8 {
    if let Some(error) = error.downcast_ref::<RunError>() {
        return match error.blame() {
            Blame::Input => 2,
            Blame::Disk => 3,
            Blame::Interrupt => 130,
        };
    }
    // What is left of plain I/O errors comes from writing to stdout or a file the user named.
    if error.downcast_ref::<io::Error>().is_some() { 3 } else { 2 }
}

/// The first Ctrl-C asks to stop, the third one insists.
fn install_interrupt() {
    static PRESSED: AtomicUsize = AtomicUsize::new(0);
    // Without a handler Ctrl-C ends the process at once, and files are whole all the same.
    let _ = ctrlc::set_handler(|| {
        INTERRUPT.request();
        if PRESSED.fetch_add(1, Ordering::Relaxed) >= 2 {
            std::process::exit(130);
        }
    });
}

/// Writes data to stdout.
fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()?;
    Ok(())
}

/// Writes one JSON document to stdout.
fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Writes a line of words to stderr.
fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}
