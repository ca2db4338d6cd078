//! What holds whatever the data.
