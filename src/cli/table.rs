//! Tables for people: the first column to the left, numbers to the right.

use lumislice::words::without_sign_of_zero;

/// Lines of aligned columns, indented by two; every row is as long as the header.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let length = |text: &str| text.chars().count();
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|cell| length(cell));
        cells.chain([length(header[column])]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let cells = cells.zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    let mut text = line(&mut header.iter().copied());
    rows.iter().for_each(|row| text += &line(&mut row.iter().map(String::as_str)));
    text
}

/// Text broken between words into lines of at most `width` characters; a longer word keeps a line of its own. Lines
/// after the first are indented by four.
pub fn wrapped(text: &str, width: usize) -> String {
    let mut out = String::with_capacity(text.len() + 8);
    let mut column = 0;
    for word in text.split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if column > 0 && column + length > width && out.trim_start() != "" {
            out.truncate(out.trim_end().len());
            out += "\n    ";
            column = 4;
        }
        out += word;
        column += word.chars().count();
    }
    out
}

/// Every line of a text [`wrapped`].
pub fn fitted(text: &str, width: usize) -> String {
    text.split_inclusive('\n').map(|line| wrapped(line, width)).collect()
}

/// Least characters of a line that a comment is broken into.
const COMMENT: usize = 20;

/// TOML with its comments broken between words, what follows below its beginning; values are left as they are.
pub fn fitted_toml(text: &str, width: usize) -> String {
    let fit = |line: &str| -> String {
        let begins = if line.starts_with("# ") { Some(0) } else { outside_quotes(line) };
        let Some((code, comment)) = begins.map(|at| line.split_at(at)) else { return line.to_owned() };
        let column = code.chars().count();
        if line.chars().count() <= width || column + COMMENT > width {
            return line.to_owned();
        }
        let mut out = code.to_owned();
        let mut length = column;
        for (n, word) in comment.split(' ').enumerate() {
            let letters = word.chars().count();
            if n > 1 && length + 1 + letters > width {
                out += &format!("\n{}#", " ".repeat(column));
                length = column + 1;
            }
            if n > 0 {
                out.push(' ');
                length += 1;
            }
            out += word;
            length += letters;
        }
        out
    };
    let lines: Vec<String> = text.split('\n').map(fit).collect();
    lines.join("\n")
}

/// Where the comment of a line begins that is no part of a text in quotation marks, in which a backslash takes the
/// meaning from the mark after it.
fn outside_quotes(line: &str) -> Option<usize> {
    let (mut quoted, mut escaped) = (None, false);
    for (at, letter) in line.char_indices() {
        match (quoted, letter) {
            (Some('"'), '\\') => escaped = !escaped,
            (Some(mark), _) if letter == mark && !escaped => quoted = None,
            (Some(_), _) => escaped = false,
            (None, '"' | '\'') => quoted = Some(letter),
            (None, '#') if line[..at].ends_with(' ') && line[at + 1..].starts_with(' ') => return Some(at),
            (None, _) => {}
        }
    }
    None
}

/// A number with so many decimals, or a dash for none. What rounds to zero has no sign.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value else { return "–".to_owned() };
    without_sign_of_zero(format!("{value:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_go_on_below_their_beginning() {
        let text = "# A job of very many words\nmesh = \"a # b\"\nscale = 1.0     # 20 mm × 20 mm as the file has it\n";
        let fitted = fitted_toml(text, 38);
        let expected = "# A job of very many words\nmesh = \"a # b\"\nscale = 1.0     # 20 mm × 20 mm as the\n                # file has it\n";
        assert_eq!(fitted, expected);
        assert_eq!(fitted_toml(text, 20).lines().next(), Some("# A job of very many"));
        // Marks that are escaped, or of the other kind, end no text.
        let text = "mesh = \"a \\\" # b.stl\"     # as the file has it";
        assert_eq!(outside_quotes(text), text.rfind('#'));
        assert_eq!(outside_quotes("mesh = 'a \" b \\'  # c"), Some(18));
        assert_eq!(outside_quotes("mesh = \"a # b"), None);
        let text = "# A job of very many words\nscale = 1.0     # 20 mm × 20 mm as the file has it\n";
        // What was broken says the same.
        let words = |text: &str| text.replace('#', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(&fitted_toml(text, 24)), words(text));
    }

    #[test]
    fn columns_are_aligned_by_characters() {
        let rows = [vec!["häschen".to_owned(), "1".to_owned()], vec!["b".to_owned(), "22.5".to_owned()]];
        assert_eq!(table(&["name", "mm"], &rows), "  name       mm\n  häschen     1\n  b        22.5\n");
        assert_eq!((number(Some(-0.004), 2), number(Some(-0.006), 2)), ("0.00".to_owned(), "-0.01".to_owned()));
        assert_eq!(wrapped("a warning: of many words", 12), "a warning:\n    of many\n    words");
        assert_eq!(wrapped("  as/long/as/a/path is", 8), "  as/long/as/a/path\n    is");
        assert_eq!(fitted("a few words\nand some more\n", 9), "a few\n    words\nand some\n    more\n");
        assert_eq!((number(None, 2), number(Some(1.005), 1)), ("–".to_owned(), "1.0".to_owned()));
    }
}
