//! Tables for people: the first column to the left, numbers to the right.

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

/// A number with so many decimals, or a dash for none. What rounds to zero has no sign.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value else { return "–".to_owned() };
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_by_characters() {
        let rows = [vec!["häschen".to_owned(), "1".to_owned()], vec!["b".to_owned(), "22.5".to_owned()]];
        assert_eq!(table(&["name", "mm"], &rows), "  name       mm\n  häschen     1\n  b        22.5\n");
        assert_eq!((number(Some(-0.004), 2), number(Some(-0.006), 2)), ("0.00".to_owned(), "-0.01".to_owned()));
        assert_eq!((number(None, 2), number(Some(1.005), 1)), ("–".to_owned(), "1.0".to_owned()));
    }
}
