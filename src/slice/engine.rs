//! Slab after slab: the memory of a job is one slab and the objects, whatever the height.

use std::{collections::HashMap, ops::Range};

use rayon::prelude::*;

use super::{depth::SlabField, field::ObjectField, fill::FillScratch};
use crate::voxel::{BlockShape, FractionSlab, Lattice, Slab};

/// Computes a lattice of material ids from objects, slab by slab.
#[derive(Debug)]
pub struct Slicer {
    lattice: Lattice,
    objects: Vec<ObjectField>,
}

impl Slicer {
    /// A slicer of `objects`, all prepared for `lattice`. Where objects overlap, the earlier one owns the voxel.
    pub fn new(lattice: Lattice, objects: Vec<ObjectField>) -> Self {
        Self { lattice, objects }
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The objects.
    pub fn objects(&self) -> &[ObjectField] {
        &self.objects
    }

    /// The objects again, to be prepared otherwise.
    pub fn into_objects(self) -> Vec<ObjectField> {
        self.objects
    }

    /// The same objects on another lattice of the same frame.
    pub fn resampled(&self, lattice: Lattice) -> Self {
        Self { lattice, objects: self.objects.iter().map(|object| object.resampled(lattice)).collect() }
    }

    /// Hands every slab that holds one of `slices` to `sink`, bottom up. The first error of the sink ends the walk.
    pub fn for_each_slab<E>(&self, slices: Range<u32>, sink: impl FnMut(&Slab) -> Result<(), E>) -> Result<(), E> {
        self.for_each_wanted_slab(slices, |_| true, sink)
    }

    /// Like [`Self::for_each_slab`], leaving out the slabs whose range of slices is not `wanted`.
    pub fn for_each_wanted_slab<E>(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        mut sink: impl FnMut(&Slab) -> Result<(), E>,
    ) -> Result<(), E> {
        self.walk(slices, wanted, false, |slab, _| sink(slab))
    }

    /// Whether voxels of some object are drawn by lot: of mixtures, or at boundaries that are dithered.
    pub fn draws_by_lot(&self) -> bool {
        self.objects.iter().any(ObjectField::is_drawn_by_lot)
    }

    /// Like [`Self::for_each_wanted_slab`], with the volume fractions of the slab's resins beside its voxels; `None`
    /// where [nothing is drawn by lot](Self::draws_by_lot) and voxels are the fractions.
    pub fn for_each_slab_with_fractions<E>(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        sink: impl FnMut(&Slab, Option<&FractionSlab>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.walk(slices, wanted, self.draws_by_lot(), sink)
    }

    fn walk<E>(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        with_fractions: bool,
        mut sink: impl FnMut(&Slab, Option<&FractionSlab>) -> Result<(), E>,
    ) -> Result<(), E> {
        let height = BlockShape::for_lattice(&self.lattice).voxels()[2];
        let slices = slices.start..slices.end.min(self.lattice.dims[2]);
        if slices.is_empty() {
            return Ok(());
        }
        let mut slab = Slab::new(self.lattice);
        let mut fractions = with_fractions.then(|| FractionSlab::new(self.lattice));
        let mut alone = SlabField::default();
        // Of every body of several objects, by the first of them.
        let mut bodies: HashMap<usize, SlabField> = HashMap::new();
        for index in slices.start / height..slices.end.div_ceil(height) {
            slab.reset(index);
            let range = slab.slices();
            if !wanted(range.clone()) {
                continue;
            }
            if let Some(fractions) = &mut fractions {
                fractions.reset(index);
            }
            for (n, object) in self.objects.iter().enumerate() {
                let field = match object.members() {
                    None => {
                        alone.prepare(object, range.clone());
                        &alone
                    }
                    Some(members) => {
                        let body = bodies.entry(members[0]).or_default();
                        if members[0] == n {
                            body.prepare_body(&self.objects, members, range.clone());
                        }
                        &*body
                    }
                };
                let blocks = slab.blocks_mut();
                match &mut fractions {
                    None => blocks.for_each_init(FillScratch::default, |scratch, (first, block)| {
                        object.fill_block(first, field, block, None, scratch);
                    }),
                    Some(fractions) => blocks.zip(fractions.blocks_mut()).for_each_init(
                        FillScratch::default,
                        |scratch, ((first, block), (_, fractions))| {
                            object.fill_block(first, field, block, Some(fractions), scratch);
                        },
                    ),
                }
            }
            sink(&slab, fractions.as_ref())?;
        }
        Ok(())
    }
}
