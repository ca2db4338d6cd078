//! The files of slices: which there are, and how slabs are written to them.

use std::{collections::BTreeMap, ops::Range, path::PathBuf};

use crate::{
    container::{SliceImage, bmp},
    job::{Prepared, RunError, file::OutputFormat},
    output::{OutputError, OutputFolder, SliceCounts},
    parallel,
    slice::{RowBuffers, encode_mask, encode_rgba},
    voxel::{MaterialId, Slab},
    watch::Watch,
};

/// Path of the image of slice `k`.
pub(in crate::job) fn slice_path(k: u32) -> String {
    format!("slices/slice_{k}.png")
}

fn mask_path(resin: &str, k: u32) -> String {
    format!("masks/{resin}/slice_{k}.png")
}

/// Where slabs go.
pub(super) struct Sinks<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) output: &'a OutputFolder,
    /// Slices that need no writing.
    pub(super) kept: &'a BTreeMap<u32, SliceCounts>,
    pub(super) watch: &'a dyn Watch,
}

/// Buffers of one worker.
#[derive(Default)]
struct Buffers {
    rows: RowBuffers,
    file: Vec<u8>,
    /// [`Prepared::bitmap_materials`], once they are asked for.
    bitmaps: Option<Vec<MaterialId>>,
}

impl Sinks<'_> {
    /// Writes the slices of `slab` that are in `slices`, adding their voxels to `counts`. Returns their images, kept
    /// ones' too, where those are wanted.
    pub(super) fn take(
        &self,
        slab: &Slab,
        slices: &Range<u32>,
        counts: &mut [u64; 256],
        images: bool,
    ) -> Result<Vec<SliceImage>, RunError> {
        let held = slab.slices();
        let wanted = held.start.max(slices.start)..held.end.min(slices.end);
        let wanted: Vec<u32> = wanted.filter(|k| images || !self.kept.contains_key(k)).collect();
        let written = parallel::map_in(wanted.len(), Buffers::default, |buffers, n| {
            let (slice, mut png) = (wanted[n], Vec::new());
            let counts = self.take_slice(slab, slice, buffers, images.then_some(&mut png))?;
            Ok((counts, images.then_some(SliceImage { slice, png })))
        });
        let written: Vec<([u64; 256], Option<SliceImage>)> = written.into_iter().collect::<Result<_, RunError>>()?;
        for (slice, _) in &written {
            counts.iter_mut().zip(slice).for_each(|(count, voxels)| *count += voxels);
        }
        Ok(written.into_iter().filter_map(|(_, image)| image).collect())
    }

    fn take_slice(
        &self,
        slab: &Slab,
        k: u32,
        buffers: &mut Buffers,
        image: Option<&mut Vec<u8>>,
    ) -> Result<[u64; 256], RunError> {
        self.watch.go_on()?;
        if self.kept.contains_key(&k) {
            // Its files are there and its voxels counted; only its image is wanted.
            self.prepared.encode_slice(slab, k, buffers, image, |_, _| Ok(()))?;
            return Ok([0; 256]);
        }
        let write = |path: &str, content: &[u8]| Ok(self.output.write(path, content)?);
        let counts = self.prepared.encode_slice(slab, k, buffers, image, write)?;
        let occurring = (0..=u8::MAX).map(|id| (id, counts[usize::from(id)])).filter(|&(_, voxels)| voxels > 0);
        self.output.finish_slice(k, occurring.collect())?;
        self.watch.advance(1);
        Ok(counts)
    }
}

impl Prepared {
    /// Hands the files of slice `k` to `take`, copies its image into `image`, and counts its voxels.
    fn encode_slice(
        &self,
        slab: &Slab,
        k: u32,
        buffers: &mut Buffers,
        image: Option<&mut Vec<u8>>,
        mut take: impl FnMut(&str, &[u8]) -> Result<(), RunError>,
    ) -> Result<[u64; 256], RunError> {
        let encoding = |source: std::io::Error| OutputError::Io {
            action: "encoding",
            path: PathBuf::from(format!("slice {k}")),
            source,
        };
        let mut counts = [0; 256];
        let Buffers { rows, file, bitmaps } = buffers;
        file.clear();
        if self.job.wants(OutputFormat::Png) || image.is_some() {
            encode_rgba(slab, k, &self.palette, rows, &mut counts, file).map_err(encoding)?;
        } else {
            slab.count_voxels(k, &mut counts);
        }
        if let Some(image) = image {
            image.extend_from_slice(file);
        }
        if self.job.wants(OutputFormat::Png) {
            take(&slice_path(k), file)?;
        }
        if self.job.wants(OutputFormat::Masks) {
            for (MaterialId(id), resin) in self.printed() {
                file.clear();
                encode_mask(slab, k, id, rows, file).map_err(encoding)?;
                take(&mask_path(&self.materials[resin].name, k), file)?;
            }
        }
        if self.job.wants(OutputFormat::Bmp) {
            let bitmaps = bitmaps.get_or_insert_with(|| self.bitmap_materials());
            for (number, MaterialId(id)) in (1..).zip(bitmaps) {
                file.clear();
                bmp::encode_bmp(slab, k, *id, &mut *file).map_err(encoding)?;
                take(&bmp::bitmap_path(number, k, self.lattice.dims[2]), file)?;
            }
        }
        Ok(counts)
    }

    /// Hands the files of `slices` to `take`, of those slabs that are `wanted`.
    pub(in crate::job) fn for_each_sliced_file(
        &self,
        slices: Range<u32>,
        wanted: impl Fn(Range<u32>) -> bool,
        watch: &dyn Watch,
        mut take: impl FnMut(&str, &[u8]),
    ) -> Result<(), RunError> {
        let mut buffers = Buffers::default();
        self.slicer().for_each_wanted_slab(slices.clone(), wanted, |slab| {
            for k in slab.slices().filter(|k| slices.contains(k)) {
                watch.go_on()?;
                self.encode_slice(slab, k, &mut buffers, None, |path, content| {
                    take(path, content);
                    Ok(())
                })?;
                watch.advance(1);
            }
            Ok(())
        })
    }

    /// Lists the files of slice `k` as written if an interrupted run left all of them whole.
    pub(super) fn keep_slice(&self, output: &OutputFolder, k: u32) -> bool {
        let slice = self.job.wants(OutputFormat::Png).then(|| slice_path(k));
        let masks = self.printed().filter(|_| self.job.wants(OutputFormat::Masks));
        let masks = masks.map(|(_, resin)| mask_path(&self.materials[resin].name, k));
        let bitmaps = if self.job.wants(OutputFormat::Bmp) { self.bitmap_materials().len() } else { 0 };
        let bitmaps = (1..=bitmaps).map(|number| bmp::bitmap_path(number, k, self.lattice.dims[2]));
        slice.into_iter().chain(masks).chain(bitmaps).all(|path| output.keep(&path))
    }
}
