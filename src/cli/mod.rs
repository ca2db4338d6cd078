//! The command line: arguments in, words to stderr, data to stdout, an exit code out.
//!
//! Only this room prints. Exit codes: 0 done; 1 done, but the answer is no; 2 bad usage, job or input; 3 reading or
//! writing the output failed; 130 interrupted.

mod cache;
mod compare;
mod convert;
mod coupon;
mod events;
mod factor;
mod failure;
mod fit;
mod gamut;
mod look;
mod match_plot;
mod match_target;
mod material;
mod materials;
mod measure;
mod output_file;
mod plots;
mod predict;
mod preview;
mod printers;
mod progress;
mod shell;
mod simulate;
mod slice;
mod start;
mod table;
mod tell;
mod verify;

use std::{
    borrow::Cow,
    io::{self, IsTerminal, Write},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    process::ExitCode,
    sync::{
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc,
    },
    time::Duration,
};

use clap::{
    ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand,
    error::{ContextKind, ContextValue, ErrorKind},
};
use lumislice::{
    watch::Interrupt,
    words::{escaped_lines, in_mm},
};

use failure::{Failure, INTERRUPTED, refusal};
use table::{fitted, fitted_toml};
use tell::{Progress, document, fail, note, say, say_no, styled, warn, warn_of};

/// Slices meshes into voxels of resin that scatter light as specified.
#[derive(Debug, Parser)]
#[command(name = "lumislice", version, about, max_term_width = 100, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// How progress is told on stderr; with `json` all that is told is one JSON object a line (docs/events.md).
    #[arg(long, global = true, value_enum, default_value_t, value_name = "HOW", help_heading = "Work")]
    progress: Progress,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(start::InitArgs),
    Slice(slice::SliceArgs),
    Predict(predict::PredictArgs),
    Match(match_target::MatchArgs),
    Gamut(gamut::GamutArgs),
    Material(material::MaterialArgs),
    Factor(factor::FactorArgs),
    Compare(compare::CompareArgs),
    Look(look::LookArgs),
    Preview(preview::PreviewArgs),
    Convert(convert::ConvertArgs),
    Verify(verify::VerifyArgs),
    Printers(printers::PrintersArgs),
    Schema(start::SchemaArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

/// What commands and their parts end with.
type Result<T, E = Failure> = std::result::Result<T, E>;

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
    let cli = match parsed() {
        Ok((cli, command)) => {
            cli.progress.begin(Some(&command));
            cli
        }
        Err(error) => return refused(error),
    };
    install_interrupt();
    let result = match (catch_unwind(AssertUnwindSafe(|| carry_out(&cli.command))), tell::events()) {
        (Ok(result), _) => result,
        (Err(panic), None) => resume_unwind(panic),
        (Err(_), Some(events)) => {
            tell::tell_panic(events);
            return ExitCode::from(tell::PANICKED);
        }
    };
    let (code, failed_as) = match &result {
        Ok(Answer::Yes) => (0, None),
        Ok(Answer::No) => (1, None),
        Err(failure) => {
            fail(failure);
            (failure.exit_code(), Some(failure.outcome()))
        }
    };
    if let Some(events) = tell::events() {
        events.finished(code, failed_as);
    }
    ExitCode::from(code)
}

fn carry_out(command: &Command) -> Result<Answer> {
    match command {
        Command::Init(args) => start::init(args),
        Command::Slice(args) => slice::run(args),
        Command::Predict(args) => predict::run(args),
        Command::Match(args) => match_target::run(args),
        Command::Gamut(args) => gamut::run(args),
        Command::Material(args) => material::run(args),
        Command::Factor(args) => factor::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Look(args) => look::run(args),
        Command::Preview(args) => preview::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Printers(args) => printers::run(args),
        Command::Schema(args) => start::schema(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}

/// The arguments, and the command that they name.
fn parsed() -> std::result::Result<(Cli, String), clap::Error> {
    let matches = Cli::command().try_get_matches()?;
    let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut Cli::command()))?;
    let levels = std::iter::successors(Some(&matches), |matches| Some(matches.subcommand()?.1));
    let names: Vec<_> = levels.filter_map(ArgMatches::subcommand_name).collect();
    Ok((cli, names.join(" ")))
}

/// Tells what is wrong with the arguments, or the help that they ask for.
fn refused(mut error: clap::Error) -> ExitCode {
    let code = if error.use_stderr() { 2 } else { 0 };
    name_the_unit(&mut error);
    Progress::of_arguments(std::env::args_os()).begin(None);
    match tell::events().filter(|_| code == 2) {
        Some(events) => {
            let text = error.render().to_string();
            events.failed("usage", text.strip_prefix("error: ").unwrap_or(&text).trim_end(), code, "failed");
        }
        // A closed pipe is no reason to fail twice.
        None if code == 2 && io::stderr().is_terminal() => {
            let _ = write!(io::stderr(), "{}", styled(&fitted(&error.render().to_string(), WIDTH)));
        }
        None => {
            let _ = error.print();
            if let Some(events) = tell::events() {
                events.finished(code, None);
            }
        }
    }
    ExitCode::from(code)
}

/// Of a flag in another unit of length says the one in mm, and what its unit is in that.
fn name_the_unit(error: &mut clap::Error) {
    let Some(ContextValue::String(flag)) = error.get(ContextKind::InvalidArg) else { return };
    let Some((name, rate)) = flag.strip_prefix("--").and_then(in_mm) else { return };
    let is_flag = |command: &clap::Command| command.get_arguments().any(|arg| arg.get_long() == Some(name.as_str()));
    if error.kind() == ErrorKind::UnknownArgument && Cli::command().get_subcommands().any(is_flag) {
        let tip = format!("lengths are in mm: --{name}, and {rate}");
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
}

/// Whether the first Ctrl-C may end the process where it stands.
static AT_ONCE: AtomicBool = AtomicBool::new(false);

/// From here on nothing is being written, and Ctrl-C need not wait for anyone to look.
fn leave_at_once() {
    AT_ONCE.store(true, Ordering::Relaxed);
    if INTERRUPT.requested() {
        leave();
    }
}

/// How long it is tried to tell of the end: who reads stderr and stops to would else keep the process for ever.
const LAST_WORDS: Duration = Duration::from_secs(1);

fn leave() -> ! {
    let (told, heard) = mpsc::channel();
    std::thread::spawn(move || {
        let failure = Failure::interrupted("interrupted");
        match tell::events() {
            Some(events) => events.failed(failure.kind(), failure.text(), INTERRUPTED, failure.outcome()),
            None => fail(&failure),
        }
        let _ = told.send(());
    });
    let _ = heard.recv_timeout(LAST_WORDS);
    std::process::exit(i32::from(INTERRUPTED))
}

/// The first Ctrl-C asks to stop, the second one insists.
fn install_interrupt() {
    static PRESSED: AtomicUsize = AtomicUsize::new(0);
    // Without a handler Ctrl-C ends the process at once, and files are whole all the same.
    let _ = ctrlc::set_handler(|| {
        INTERRUPT.request();
        if PRESSED.fetch_add(1, Ordering::Relaxed) >= 1 || AT_ONCE.load(Ordering::Relaxed) {
            leave();
        }
    });
}

/// Writes data to stdout. A reader that has seen enough, as `head`, is no error.
fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    // A pipe takes what it is given.
    let shown = if stdout.is_terminal() { Cow::Owned(escaped_lines(text)) } else { Cow::Borrowed(text) };
    match stdout.write_all(shown.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(Failure::writing("stdout", error)),
        Ok(()) => Ok(()),
    }
}

/// Writes words to stdout: lines as they are, but broken between words on a terminal.
fn print_words(text: &str) -> Result<()> {
    if io::stdout().is_terminal() { print(&fitted(text, WIDTH)) } else { print(text) }
}

/// Writes a commented job to stdout, its comments broken between words on a terminal.
fn print_toml(text: &str) -> Result<()> {
    if io::stdout().is_terminal() { print(&fitted_toml(text, WIDTH)) } else { print(text) }
}

/// Writes one JSON document to stdout.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| refusal!("{error}"))?;
    print(&(text + "\n"))
}

/// Characters in a line of words on a terminal.
const WIDTH: usize = 80;
