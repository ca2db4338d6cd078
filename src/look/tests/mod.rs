mod slabs;
mod spots;
