//! TOML read key by key, with types and ranges, so that every complaint says where and what.
//!
//! **In:** the text of a file. **Out:** values of the types and ranges asked for, or a [`Fault`]: the place, the key,
//! what was found and what was expected. Unknown keys are found before others and carry the known ones, of which the
//! nearest may be meant. How a fault reads is its room's own: `E` is the room's error, made from a fault, and [`Found`]
//! says how values are named.
//!
//! | file | what it does |
//! | --- | --- |
//! | `source` | the text, and where in it a byte is |
//! | `table`  | keys: known, required, exclusive; values by key |
//! | `value`  | one value as a number, a text, a choice, a list |
//! | `range`  | what a number may be |

mod fault;
mod range;
mod source;
mod table;
mod value;

pub use fault::Place;
pub(crate) use fault::{Fault, Problem};
pub(crate) use range::{IntRange, Range};
pub(crate) use source::{Found, Places, Source};
pub(crate) use table::{At, Strings, Table};
pub(crate) use value::Value;
