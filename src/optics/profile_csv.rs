//! Profiles as CSV files.
//!
//! The header names the columns, in any order: `r_mm`, and `reflection_per_mm2`, `transmission_per_mm2` or both;
//! optionally `reflection_se`, `transmission_se` (one standard deviation) and `r_lo_mm`, `r_hi_mm` (edges: the values
//! are means over contiguous rings from 0, and `r_mm` only informs). Lines that start with `#` are comments.

use std::fmt::Write as _;
use std::path::Path;

use super::{OpticsError, ProfileError, RadialProfile};

const RADIUS: &str = "r_mm";
const RING_LOW: &str = "r_lo_mm";
const RING_HIGH: &str = "r_hi_mm";
const REFLECTION: &str = "reflection_per_mm2";
const TRANSMISSION: &str = "transmission_per_mm2";
const REFLECTION_ERROR: &str = "reflection_se";
const TRANSMISSION_ERROR: &str = "transmission_se";
const COLUMNS: [&str; 7] =
    [RADIUS, RING_LOW, RING_HIGH, REFLECTION, REFLECTION_ERROR, TRANSMISSION, TRANSMISSION_ERROR];

/// Rings in a file touch if their edges agree to this share: edges are printed with four decimals or six digits.
const EDGE_TOLERANCE: f64 = 1e-5;

/// No light comes back more than once; coarse samples of a profile that peaks at the centre may integrate to a little
/// more.
const MOST_ENERGY: f64 = 1.05;

/// What a profile file holds; at least one of the two.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileFile {
    /// R(r).
    pub reflection: Option<RadialProfile>,
    /// T(r); `None` also where the column holds zeros only, as it does for what lies on a core.
    pub transmission: Option<RadialProfile>,
}

impl ProfileFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`OpticsError::File`] if it cannot be read, [`OpticsError::Entry`] with the line where it breaks the format.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let text = crate::regular_file::read_text(path)
            .map_err(|source| OpticsError::File { file: path.to_path_buf(), source })?;
        Self::parse(&text, path)
    }

    /// Reads a file's R(r).
    ///
    /// # Errors
    /// As [`Self::read`]; [`OpticsError::Entry`] for a file without it.
    pub fn read_reflection(path: &Path) -> Result<RadialProfile, OpticsError> {
        Self::read(path)?.reflection.ok_or_else(|| OpticsError::Entry {
            file: path.to_path_buf(),
            line: None,
            element: "header".to_owned(),
            found: format!("no {REFLECTION} column"),
            expected: "one".to_owned(),
        })
    }

    /// Reads a text; `path` names it in errors.
    ///
    /// # Errors
    /// [`OpticsError::Entry`] with the line where it breaks the format.
    pub fn parse(text: &str, path: &Path) -> Result<Self, OpticsError> {
        Table::parse(text, path)?.profiles()
    }

    /// Writes the file, `comment` first, each of its lines after `# `.
    ///
    /// # Errors
    /// [`OpticsError::File`] if it cannot be written.
    pub fn write(&self, path: &Path, comment: &str) -> Result<(), OpticsError> {
        std::fs::write(path, self.to_csv(comment))
            .map_err(|source| OpticsError::File { file: path.to_path_buf(), source })
    }

    /// The text of the file. Where both profiles are given they share the radii of the reflection; ring edges and
    /// standard errors are written if known. Six significant digits, which is below the noise of 10⁹ photons.
    pub fn to_csv(&self, comment: &str) -> String {
        let profiles =
            [(&self.reflection, REFLECTION, REFLECTION_ERROR), (&self.transmission, TRANSMISSION, TRANSMISSION_ERROR)];
        let Some(axis) = self.reflection.as_ref().or(self.transmission.as_ref()) else { return String::new() };
        let mut header = Vec::new();
        let mut columns: Vec<&[f64]> = Vec::new();
        if let Some(edges) = axis.ring_edges() {
            header.extend([RING_LOW, RING_HIGH]);
            columns.extend([&edges[..edges.len() - 1], &edges[1..]]);
        }
        header.push(RADIUS);
        columns.push(axis.r_mm());
        for (profile, name, error_name) in profiles {
            let Some(profile) = profile else { continue };
            header.push(name);
            columns.push(profile.value_per_mm2());
            if let Some(errors) = profile.standard_error() {
                header.push(error_name);
                columns.push(errors);
            }
        }
        let mut text: String = comment.lines().map(|line| format!("# {line}\n")).collect();
        text.push_str(&header.join(","));
        text.push('\n');
        for row in 0..axis.r_mm().len() {
            for (i, column) in columns.iter().enumerate() {
                let separator = if i == 0 { "" } else { "," };
                let value = column.get(row).copied().unwrap_or(f64::NAN);
                let _ = write!(text, "{separator}{}", six_digits(value)); // writing to a String cannot fail
            }
            text.push('\n');
        }
        text
    }
}

/// Six significant digits in the shortest form that reads back to them.
pub(super) fn six_digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// The numbers of a file, by column, with the line of each row.
struct Table<'a> {
    path: &'a Path,
    header_line: usize,
    lines: Vec<usize>,
    columns: [Option<Vec<f64>>; COLUMNS.len()],
}

impl<'a> Table<'a> {
    fn parse(text: &str, path: &'a Path) -> Result<Self, OpticsError> {
        let rows = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim_start_matches('\u{feff}').trim()));
        let mut rows = rows.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let entry = |line, element: &str, found: String, expected: String| OpticsError::Entry {
            file: path.to_path_buf(),
            line,
            element: element.into(),
            found,
            expected,
        };
        let expected_header = || format!("{RADIUS},{REFLECTION}[,{TRANSMISSION}]");
        let Some((header_line, header)) = rows.next() else {
            return Err(entry(None, "header", "an empty file".into(), expected_header()));
        };
        let mut order = Vec::new();
        for name in header.split(',').map(str::trim) {
            let Some(column) = COLUMNS.iter().position(|known| *known == name) else {
                let hint = crate::words::suggest(name, COLUMNS).map(|near| format!(" (did you mean {near}?)"));
                let expected = format!("{}{}", expected_header(), hint.unwrap_or_default());
                return Err(entry(Some(header_line), "header", format!("column `{name}`"), expected));
            };
            if order.contains(&column) {
                return Err(entry(Some(header_line), "header", format!("`{name}` twice"), "each column once".into()));
            }
            order.push(column);
        }
        let mut table = Self { path, header_line, lines: Vec::new(), columns: Default::default() };
        order.iter().for_each(|&column| table.columns[column] = Some(Vec::new()));
        let missing = |name: &str| table.column(name).is_none();
        if missing(RADIUS) || (missing(REFLECTION) && missing(TRANSMISSION)) || missing(RING_LOW) != missing(RING_HIGH)
        {
            return Err(entry(Some(header_line), "header", format!("`{header}`"), expected_header()));
        }
        for (line, row) in rows {
            let cells: Vec<&str> = row.split(',').map(str::trim).collect();
            if cells.len() != order.len() {
                let expected = format!("{}, as in the header", order.len());
                return Err(entry(Some(line), "row", format!("{} columns", cells.len()), expected));
            }
            for (cell, &column) in cells.iter().zip(&order) {
                let number: f64 = cell
                    .parse()
                    .map_err(|_| entry(Some(line), COLUMNS[column], format!("`{cell}`"), "a number".into()))?;
                if let Some(values) = &mut table.columns[column] {
                    values.push(number);
                }
            }
            table.lines.push(line);
        }
        Ok(table)
    }

    fn column(&self, name: &str) -> Option<&Vec<f64>> {
        self.columns[COLUMNS.iter().position(|known| *known == name)?].as_ref()
    }

    fn profiles(&self) -> Result<ProfileFile, OpticsError> {
        Ok(ProfileFile {
            reflection: self.profile(REFLECTION, REFLECTION_ERROR)?,
            transmission: match self.column(TRANSMISSION) {
                Some(dark) if self.column(REFLECTION).is_some() && dark.iter().all(|value| *value == 0.0) => None,
                _ => self.profile(TRANSMISSION, TRANSMISSION_ERROR)?,
            },
        })
    }

    fn profile(&self, name: &str, error_name: &str) -> Result<Option<RadialProfile>, OpticsError> {
        let Some(values) = self.column(name) else { return Ok(None) };
        let errors = self.column(error_name).cloned();
        let result = match (self.column(RING_LOW), self.column(RING_HIGH)) {
            (Some(low), Some(high)) => {
                for row in 1..low.len() {
                    if (low[row] - high[row - 1]).abs() > EDGE_TOLERANCE * high[row - 1].abs() {
                        let expected = format!("the previous ring's outer edge, {}", high[row - 1]);
                        return Err(self.entry(Some(self.lines[row]), RING_LOW, low[row].to_string(), expected));
                    }
                }
                let edges = low.first().copied().into_iter().chain(high.iter().copied()).collect();
                RadialProfile::from_rings(edges, values.clone(), errors)
            }
            _ => {
                let radii = self.column(RADIUS).cloned().unwrap_or_default();
                RadialProfile::from_points(radii, values.clone(), errors)
            }
        };
        let profile = result.map_err(|ProfileError { index, found, expected }| {
            let line = self.lines.get(index).or(self.lines.last()).copied().unwrap_or(self.header_line);
            self.entry(Some(line), name, found, expected)
        })?;
        let energy = profile.energy();
        if energy > MOST_ENERGY {
            let expected = "at most 1: values are per mm², radii in mm".to_owned();
            return Err(self.entry(Some(self.header_line), name, format!("an albedo of {energy:.4}"), expected));
        }
        Ok(Some(profile))
    }

    fn entry(&self, line: Option<usize>, element: &str, found: String, expected: String) -> OpticsError {
        OpticsError::Entry { file: self.path.to_path_buf(), line, element: element.into(), found, expected }
    }
}
