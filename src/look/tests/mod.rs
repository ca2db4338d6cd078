mod skin;
mod slabs;
mod spots;
