//! `lumislice completions` and `man`: made from the same definitions as the commands.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{
    Answer, Cli, Result,
    failure::{Failure, refusal},
    print,
};

/// Print a completion script for a shell.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Print the manual page, roff; `lumislice man | man -l -` shows it.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The page of a command, as `predict` or `material show`; default: the overview.
    command: Vec<String>,
}

/// Runs `completions`.
pub fn completions(args: &CompletionsArgs) -> Result<Answer> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "lumislice", &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(Answer::Yes)
}

/// Runs `man`.
pub fn man(args: &ManArgs) -> Result<Answer> {
    let mut root = Cli::command();
    root.build(); // gives subcommands their full names and inherited settings
    let mut command = &root;
    for name in &args.command {
        let known: Vec<_> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
        command = command.find_subcommand(name).ok_or_else(|| {
            refusal!("{}: found no command `{name}`, expected one of {}", command.get_name(), known.join(", "))
        })?;
    }
    let title = args.command.iter().fold("lumislice".to_owned(), |title, name| format!("{title}-{name}"));
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone())
        .title(title)
        .render(&mut page)
        .map_err(|error| Failure::writing("page", error))?;
    print(&String::from_utf8_lossy(&page))?;
    Ok(Answer::Yes)
}
