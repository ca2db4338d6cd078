//! room

pub mod printer;

pub use printer::Printer;
