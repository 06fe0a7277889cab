//! From the header of a table to the cells that hold its quantities.

use crate::columns::{self, Column, IGNORE, Quantity, Role};
use crate::error::{Error, Result};
use crate::formats::{self, Dialect};
use crate::rows::Options;
use serde::Serialize;

/// A column that is neither known nor mapped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Ignored {
    /// Its name in the header, shortened to 80 characters.
    pub column: String,
    /// The known name that may have been meant.
    pub did_you_mean: Option<&'static str>,
}

/// What a table is read for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    Measurements,
    Positions,
}

impl Purpose {
    fn wants(self, quantity: Quantity, options: &Options) -> bool {
        use Quantity::*;
        match quantity.role() {
            Role::Time | Role::Label => true,
            _ if quantity.is_size() => self == Purpose::Measurements && options.sizes,
            Role::Measurement => {
                self == Purpose::Measurements
                    || matches!(quantity, X | Y | Z | Latitude | Longitude | Altitude)
            }
            Role::Estimate => self == Purpose::Positions,
        }
    }
}

/// A known column and where it is.
#[derive(Clone, Copy)]
pub(crate) struct Slot {
    pub cell: usize,
    pub column: &'static Column,
}

/// Which cell of a row holds what.
pub(crate) struct Layout {
    pub dialect: &'static Dialect,
    pub header: Vec<String>,
    /// In order of preference.
    pub times: Vec<Slot>,
    pub numbers: Vec<Slot>,
    pub id: Option<usize>,
    pub sensor: Option<usize>,
    pub scan: Option<usize>,
    /// Cell, text and reason of rows that are no measurement.
    pub leave_out: Option<(usize, &'static str, &'static str)>,
    pub ignored: Vec<Ignored>,
}

impl Layout {
    /// Finds the columns, or says why this is no such table.
    pub fn new(
        file: &str,
        line: u64,
        header: Vec<String>,
        options: &Options,
        purpose: Purpose,
    ) -> Result<Layout> {
        for column in options.columns.keys() {
            if !header.contains(column) {
                let (file, found) = (file.to_owned(), found(&header, None));
                return Err(Error::NotInHeader { file, column: shorten(column), found });
            }
        }
        let dialect = formats::dialect(file, options.format, &header)?;
        let (slots, ignored) = assign(file, &header, dialect, options, purpose)?;
        let of = |role: Role| slots.iter().filter(move |s| s.column.quantity.role() == role).copied();
        let label = |q: Quantity| slots.iter().find(|s| s.column.quantity == q).map(|s| s.cell);

        let mut times: Vec<Slot> = of(Role::Time).collect();
        let preference =
            |s: &Slot| dialect.columns.iter().position(|(name, _)| *name == header[s.cell]).unwrap_or(0);
        times.sort_by_key(preference);
        if times.is_empty() && dialect.frames.is_none() {
            // Names are not numbers: a first row with numbers and without a time is data.
            if let Some(value) = header.iter().find(|h| h.parse::<f64>().is_ok()) {
                return Err(Error::NoHeader { file: file.to_owned(), line, value: shorten(value) });
            }
            odd_unit(file, &header, options, |q| q.role() == Role::Time)?;
            return Err(Error::NoTime { file: file.to_owned(), found: found(&header, Some(Role::Time)) });
        }
        let leave_out = dialect.leave_out.and_then(|(column, cell, reason)| {
            header.iter().position(|h| h == column).map(|i| (i, cell, reason))
        });
        let numbers =
            slots.iter().filter(|s| (s.column.quantity as usize) < Quantity::NUMBERS).copied().collect();
        let (id, sensor, scan) = (label(Quantity::Id), label(Quantity::Sensor), label(Quantity::Scan));
        let layout = Layout { dialect, times, numbers, id, sensor, scan, leave_out, ignored, header };
        layout.check(file, options, purpose)?;
        Ok(layout)
    }

    /// Whether a column gives this quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.numbers.iter().any(|s| s.column.quantity == quantity)
    }

    /// Whether positions are geographic.
    pub fn geographic(&self) -> bool {
        self.has(Quantity::Latitude)
    }

    fn check(&self, file: &str, options: &Options, purpose: Purpose) -> Result<()> {
        use Quantity::*;
        let file = || file.to_owned();
        let pairs: &[(Quantity, &[Quantity], &str)] = &[
            (X, &[Y], "a y in metres or kilometres"),
            (Y, &[X], "an x in metres or kilometres"),
            (Z, &[X, Y], "x and y in metres or kilometres"),
            (Latitude, &[Longitude], "lon_deg"),
            (Longitude, &[Latitude], "lat_deg"),
            (Length, &[Width, Orientation], "width_m and an orientation or a heading"),
            (Width, &[Length, Orientation], "length_m and an orientation or a heading"),
            (Orientation, &[Length, Width], "length_m and width_m"),
            (Elevation, &[Range, Bearing], "a range and a bearing or an azimuth"),
        ];
        for (lonely, partners, needs) in pairs {
            let slot = self.numbers.iter().find(|s| s.column.quantity == *lonely);
            if let Some(slot) = slot.filter(|_| !partners.iter().all(|p| self.has(*p))) {
                let missing = |q: Quantity| partners.contains(&q) && !self.has(q);
                odd_unit(&file(), &self.header, options, missing)?;
                return Err(Error::Unpaired {
                    file: file(),
                    column: shorten(&self.header[slot.cell]),
                    needs,
                });
            }
        }
        let position = self.has(X) || self.has(Latitude);
        let polar = self.has(Range) || self.has(Bearing);
        let needed = match purpose {
            Purpose::Measurements if !(position || polar || self.has(RangeRate)) => {
                "measurement (x_m and y_m, lat_deg and lon_deg, range_m, bearing_deg, ...)"
            }
            Purpose::Positions if !position => "position (x_m and y_m, or lat_deg and lon_deg)",
            _ => "",
        };
        if !needed.is_empty() {
            odd_unit(&file(), &self.header, options, |q| {
                purpose.wants(q, options) && q.role() == Role::Measurement
            })?;
            let found = found(&self.header, Some(Role::Measurement));
            return Err(Error::NoMeasurement { file: file(), needed, found });
        }
        let height = if self.has(X) { Z } else { Altitude };
        if options.three_d && position && !self.has(height) {
            return Err(Error::NoHeight { file: file() });
        }
        if polar && self.dialect.origin.is_some() && options.origin.is_some() {
            return Err(Error::PolarOrigin { file: file() });
        }
        Ok(())
    }
}

/// Gives each column its meaning: the caller's mapping first, then the dialect's, then the contract's names.
fn assign(
    file: &str,
    header: &[String],
    dialect: &Dialect,
    options: &Options,
    purpose: Purpose,
) -> Result<(Vec<Slot>, Vec<Ignored>)> {
    let plain = dialect.columns.is_empty();
    let mut slots: Vec<Slot> = Vec::new();
    let mut ignored = Vec::new();
    let mut ignore = |column: &str, did_you_mean| {
        if !column.is_empty() {
            ignored.push(Ignored { column: shorten(column), did_you_mean });
        }
    };
    for (cell, name) in header.iter().enumerate() {
        let mapped = options.columns.get(name).map(String::as_str);
        let dialect_name = || dialect.columns.iter().find(|(own, _)| own == name).map(|(_, target)| *target);
        let Some(target) = mapped.or_else(|| if plain { Some(name.as_str()) } else { dialect_name() }) else {
            continue;
        };
        if mapped == Some(IGNORE) {
            continue;
        }
        match Column::find(target) {
            Some(column) if purpose.wants(column.quantity, options) => slots.push(Slot { cell, column }),
            // What a dialect may hold and nobody wants is not worth a word.
            Some(_) if plain || mapped.is_some() => ignore(name, None),
            Some(_) => {}
            None if mapped.is_some() => {
                let near = columns::did_you_mean(target);
                let hint = near.map_or(String::new(), |n| format!("; did you mean {n:?}?"));
                let (column, target) = (shorten(name), shorten(target));
                return Err(Error::BadMapping { file: file.to_owned(), column, target, hint });
            }
            None => {
                if let Some(meant) = wrong_case(header, options, purpose, name) {
                    return Err(Error::WrongCase { file: file.to_owned(), column: shorten(name), meant });
                }
                let wanted = |q: Quantity| !q.is_size() || options.sizes;
                match columns::other_units(name, wanted).filter(|_| columns::other_case(name).is_none()) {
                    Some(known) => {
                        return Err(Error::UnknownUnit {
                            file: file.to_owned(),
                            column: shorten(name),
                            known,
                        });
                    }
                    None => ignore(name, columns::did_you_mean(name)),
                }
            }
        }
    }
    if !plain {
        // What the caller maps replaces what the dialect says of the same quantity.
        let mapped = |s: &Slot| options.columns.contains_key(&header[s.cell]);
        let replaced: Vec<&str> = slots.iter().filter(|s| mapped(s)).map(|s| meaning(s)).collect();
        slots.retain(|s| mapped(s) || !replaced.contains(&meaning(s)));
    }
    for (i, b) in slots.iter().enumerate() {
        let time_of_dialect = !plain && b.column.quantity.role() == Role::Time;
        if let Some(a) = slots[..i].iter().find(|a| meaning(a) == meaning(b) && !time_of_dialect) {
            return Err(duplicate(file, header, a, b, meaning(b)));
        }
    }
    let first = |q: Quantity| slots.iter().find(|s| s.column.quantity == q);
    if let (Some(x), Some(lat)) = (first(Quantity::X), first(Quantity::Latitude)) {
        return Err(duplicate(file, header, x, lat, "the position"));
    }
    Ok((slots, ignored))
}

/// The known time or number that `name` is in other letters, unless another column gives it. A label in other letters
/// may be something else (a row's `ID`): it is ignored, and said.
fn wrong_case(header: &[String], options: &Options, purpose: Purpose, name: &str) -> Option<&'static str> {
    let meant = columns::other_case(name)?;
    let quantity = meant.quantity;
    let gives = |other: &String| {
        let target = options.columns.get(other).unwrap_or(other);
        Column::find(target).is_some_and(|c| c.quantity.name() == quantity.name())
    };
    let read = purpose.wants(quantity, options) && quantity.role() != Role::Label;
    (read && !header.iter().any(gives)).then_some(meant.name)
}

/// Refuses a table that lacks a wanted quantity because its unit is not known.
fn odd_unit(
    file: &str,
    header: &[String],
    options: &Options,
    wanted: impl Fn(Quantity) -> bool,
) -> Result<()> {
    let unmapped = header.iter().filter(|name| !options.columns.contains_key(*name));
    for name in unmapped {
        if let Some(known) = columns::any_units(name, &wanted) {
            return Err(Error::UnknownUnit { file: file.to_owned(), column: shorten(name), known });
        }
    }
    Ok(())
}

/// What a column gives: the same for all its units.
fn meaning(slot: &Slot) -> &'static str {
    slot.column.quantity.name()
}

fn duplicate(file: &str, header: &[String], a: &Slot, b: &Slot, quantity: &'static str) -> Error {
    let name = |s: &Slot| shorten(&header[s.cell]);
    Error::DuplicateColumn { file: file.to_owned(), first: name(a), second: name(b), quantity }
}

/// A clause about what the header holds, with the likeliest slip.
fn found(header: &[String], role: Option<Role>) -> String {
    const SHOWN: usize = 8;
    let names: Vec<_> = header.iter().take(SHOWN).map(|h| format!("{:?}", shorten(h))).collect();
    let more = if header.len() > SHOWN { ", ..." } else { "" };
    let mut text = format!("the header has {}{more}", names.join(", "));
    if header.len() == 1 && header[0].contains([';', '\t']) {
        return text + "; separate the columns by commas";
    }
    // A height is no measurement by itself, so it is not what is missing.
    let near = |h: &String| {
        columns::did_you_mean(h).filter(|n| *n != "z_m" && Column::find(n).map(|c| c.quantity.role()) == role)
    };
    if let Some((name, target)) = header.iter().find_map(|h| near(h).map(|n| (h, n))) {
        text += &format!("; does {:?} mean {target}?", shorten(name));
    }
    text
}

/// Text of a cell for a message: at most 80 characters.
pub(crate) fn shorten(text: &str) -> String {
    match text.char_indices().nth(80) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
