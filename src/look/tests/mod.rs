mod ball;
mod skin;
mod slabs;
pub(super) mod spots;
