//! The command line: arguments in, words to stderr, data to stdout, an exit code out.
//!
//! Only this room prints. Exit codes: 0 done; 1 done, but the answer is no; 2 bad usage, job or input; 3 reading or
//! writing the output failed; 130 interrupted.

mod cache;
mod compare;
mod convert;
mod coupon;
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
mod verify;

use std::{
    borrow::Cow,
    io::{self, IsTerminal, Write},
    process::ExitCode,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
};

use clap::{
    CommandFactory, Parser, Subcommand,
    error::{ContextKind, ContextValue, ErrorKind},
};
use lumislice::{
    watch::Interrupt,
    words::{escaped, escaped_lines, in_mm},
};

use failure::{Failure, INTERRUPTED, refusal};
use table::{fitted, fitted_toml, wrapped};

/// Slices meshes into voxels of resin that scatter light as specified.
#[derive(Debug, Parser)]
#[command(name = "lumislice", version, about, max_term_width = 100, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
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
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(mut error) => {
            name_the_unit(&mut error);
            let code = if error.use_stderr() { 2 } else { 0 };
            // A closed pipe is no reason to fail twice.
            let _ = match error.use_stderr() && io::stderr().is_terminal() {
                true => write!(io::stderr(), "{}", fitted(&error.render().to_string(), WIDTH)),
                false => error.print(),
            };
            return ExitCode::from(code);
        }
    };
    install_interrupt();
    let result = match &cli.command {
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
    };
    match result {
        Ok(Answer::Yes) => ExitCode::SUCCESS,
        Ok(Answer::No) => ExitCode::from(1),
        Err(failure) => {
            say(&format!("error: {}", failure.text()));
            ExitCode::from(failure.exit_code())
        }
    }
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

fn leave() -> ! {
    say("error: interrupted");
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

/// Writes words to stderr: one line, but broken between words on a terminal.
fn say(line: &str) {
    let line = escaped(line);
    let line = if io::stderr().is_terminal() { wrapped(&line, WIDTH) } else { line };
    let _ = writeln!(io::stderr(), "{line}");
}
