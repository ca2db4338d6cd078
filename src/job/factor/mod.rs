//! `lumislice factor`: a measured BSSRDF becomes a folder of local profiles, clusters and pictures, which a job prints
//! from.

mod pictures;
mod record;
mod slab;
mod texels;

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::{
    appearance::bssrdf::{
        self, BssrdfError, Channel, ClusterCount, Dataset, FactorOptions, Freedom, Metric, Rings, TailRings, areas,
        write_npy,
    },
    blame::{Blame, Blamed, Remedy},
    machine::{self, Shortage},
    optics::{FrequencyGrid, OpticsError, ProfileFile, RadialProfile},
    output::{Existing, GENERATOR, OutputError, OutputFolder, Owner, Task, pretty},
    plot::PlotError,
    watch::Watch,
    words::hex,
};

pub(in crate::job) use record::entry;
pub use record::{
    ChannelFit, ClusterRecord, FACTORED, FACTORED_VERSION, FactorSettings, Factored, RingResidual, RoundRecord,
    Simpler, TailRecord,
};
use texels::Texels;

/// Per-texel profiles, float32, rows × columns × channels × rings.
pub const PROFILES: &str = "profiles.npy";
/// How far light goes both ways, per texel: float32, rows × columns, of the first channel.
pub const RECIPROCITY: &str = "reciprocity.npy";
/// Cluster of every texel, 16-bit grey.
pub const LABELS: &str = "labels.png";

/// What to factor, and how.
#[derive(Debug, Clone)]
pub struct FactorRequest {
    /// Folder, header or archive of the dataset.
    pub dataset: PathBuf,
    /// Three channels become one.
    pub luminance: bool,
    /// The fit.
    pub options: FactorOptions,
    /// Number of clusters; `None`: 100, or as many as texels if there are fewer.
    pub count: Option<ClusterCount>,
    /// Seed of the clusters.
    pub seed: u64,
    /// Weight of the albedo in the distance of profiles.
    pub dc_weight: f64,
    /// Also fit one profile, and one profile scaled per texel, to compare with.
    pub compare: bool,
}

/// Clusters where nothing else is asked for, as in the paper.
const DEFAULT_CLUSTERS: usize = 100;

/// Why a dataset was not factored.
#[derive(Debug, thiserror::Error)]
pub enum FactorError {
    /// The dataset or an option.
    #[error(transparent)]
    Dataset(#[from] BssrdfError),
    /// The folder.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A profile that is none.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A picture.
    #[error(transparent)]
    Picture(#[from] PlotError),
}

impl Blamed for FactorError {
    fn blame(&self) -> Blame {
        match self {
            Self::Dataset(error) => error.blame(),
            Self::Output(error) => error.blame(),
            Self::Optics(error) => error.blame(),
            Self::Picture(error) => error.blame(),
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        if let Self::Output(error) = self { error.remedy() } else { None }
    }
}

/// Factors a dataset into `folder`.
///
/// # Errors
/// [`FactorError`]; files under their final names are whole, and the manifest is written last.
pub fn factor_into(
    request: &FactorRequest,
    folder: &Path,
    existing: Existing,
    watch: &dyn Watch,
) -> Result<Factored, FactorError> {
    let dataset = Dataset::open(&request.dataset, request.luminance)?;
    let texels = dataset.texels();
    let count = request.count.unwrap_or(ClusterCount::Fixed(DEFAULT_CLUSTERS.min(texels)));
    count.check(texels)?;
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();

    let rings = dataset.rings();
    refuse_too_large(&dataset, &rings)?;
    let tail_rings = TailRings::new(&rings.edges_mm);
    let edges_mm: Vec<f64> = rings.edges_mm.iter().chain(&tail_rings.edges_mm[1..]).copied().collect();
    let channels = dataset.channels.len();
    let mut profiles = Texels::new(texels, channels, edges_mm.len() - 1);
    let mut fits = Vec::new();
    for channel in 0..channels {
        let stored = if dataset.luminance { Channel::Luminance } else { Channel::Stored(channel) };
        let factors = bssrdf::factor(&dataset, stored, &request.options, watch)?;
        let mut simpler = Vec::new();
        if request.compare {
            for freedom in [Freedom::Scaled, Freedom::Global] {
                let options = FactorOptions { freedom, ..request.options };
                simpler.push((freedom, bssrdf::factor(&dataset, stored, &options, watch)?.misses));
            }
        }
        let albedo = |texel: usize| {
            let albedo = dataset.albedo.as_ref().map(|albedo| f64::from(albedo[texel * channels + channel]));
            albedo.filter(|albedo| albedo.is_finite())
        };
        let tail = profiles.fill(channel, &factors, &rings, &tail_rings, albedo);
        fits.push(ChannelFit::new(&dataset.channels[channel], &factors, &rings, tail, &simpler));
        if channel == 0 {
            files.push(("residual.png".into(), pictures::residual(&factors.misses, &dataset)?));
            let shape = [dataset.height, dataset.width];
            files.push((RECIPROCITY.into(), write_npy(&shape, &factors.reciprocity.places)));
        }
    }
    let adopted = profiles.adopt_missing(&dataset);

    watch.stage_of_thousandths("clusters");
    let metric = Metric::new(&edges_mm, &FrequencyGrid::default(), request.dc_weight)?;
    let clusters = metric.group(&profiles.energies, channels, count, request.seed)?;
    let means = profiles.means(&clusters.labels, clusters.centroids.len());
    let areas = areas(&edges_mm);
    let mut records = Vec::new();
    for (index, (energies, fit)) in means.iter().zip(&clusters.fits).enumerate() {
        let mut record = ClusterRecord {
            share: fit.weight / texels as f64,
            rms: metric.rms(fit.rms * fit.rms, 1, channels),
            worst: metric.rms(fit.worst * fit.worst, 1, channels),
            albedo: Vec::new(),
            half_energy_radius_mm: Vec::new(),
            profiles: Vec::new(),
        };
        for (channel, energies) in energies.chunks(edges_mm.len() - 1).enumerate() {
            let values = energies.iter().zip(&areas).map(|(energy, area)| energy / area).collect();
            let profile = RadialProfile::from_rings(edges_mm.clone(), values, None).map_err(OpticsError::from)?;
            record.albedo.push(energies.iter().sum());
            record.half_energy_radius_mm.push(profile.radius_of_energy(0.5));
            let suffix =
                if channels == 1 { String::new() } else { format!("_{}", file_part(&dataset.channels[channel])) };
            let path = format!("profiles/cluster_{index:03}{suffix}.csv");
            let comment = format!("mean of cluster {index}; from {} mm on fitted", tail_rings.edges_mm[0]);
            let file = ProfileFile { reflection: Some(profile), transmission: None };
            files.push((path.clone(), file.to_csv(&comment).into_bytes()));
            record.profiles.push(path);
        }
        records.push(record);
    }
    let shape = [dataset.height, dataset.width, channels, edges_mm.len() - 1];
    files.extend([
        (PROFILES.into(), write_npy(&shape, &profiles.per_mm2(&areas))),
        (LABELS.into(), pictures::labels(&clusters.labels, &dataset)),
        ("albedo.png".into(), pictures::albedo(&profiles, &dataset)),
        ("clusters.png".into(), pictures::clusters(&records, &clusters.labels, &dataset)?),
        ("palette.png".into(), pictures::palette(&records, &means, &edges_mm)?),
        (slab::MESH.into(), slab::mesh(&dataset).into_bytes()),
        (slab::JOB.into(), slab::paper(request.dc_weight).into_bytes()),
        (slab::REFINED.into(), slab::refined(request.dc_weight).into_bytes()),
    ]);
    let factored = Factored {
        generator: GENERATOR.to_owned(),
        version: FACTORED_VERSION,
        pitch_mm: dataset.pitch_mm,
        width: dataset.width,
        height: dataset.height,
        channels: dataset.channels.clone(),
        window: dataset.window,
        ring_edges_mm: edges_mm,
        window_rings: rings.len(),
        settings: FactorSettings::new(request, clusters.requested),
        fits,
        texels_without_data: adopted,
        cluster_rms: metric.rms(clusters.total, texels, channels),
        clusters: records,
    };
    files.push((FACTORED.into(), pretty(&factored)));
    // Only now: a dataset that is refused leaves nothing behind.
    let sha256 = hex(&Sha256::digest(pretty(&factored)));
    let (command, generator) = (OWNER.command.to_owned(), GENERATOR.to_owned());
    let task = Task { command, generator, sha256, slices: [0, 0] };
    let inputs = [request.dataset.clone()];
    let (output, _) = OutputFolder::begin(folder, &OWNER, existing, &task, &inputs)?;
    files.iter().try_for_each(|(path, content)| output.write(path, content))?;
    output.finish_with_list(&OWNER, FACTORED_VERSION)?;
    Ok(factored)
}

/// Refuses a dataset whose factorisation needs more memory than the machine has: a number for every texel at every
/// distance that occurs in a window, and some at every ring.
fn refuse_too_large(dataset: &Dataset, rings: &Rings) -> Result<(), BssrdfError> {
    let planes = (rings.distances_mm.len() + PLANES_PER_RING * rings.len()) as u64;
    let needed = planes * dataset.texels() as u64 * size_of::<f32>() as u64;
    let Some(Shortage { needs, expected }) = machine::short_of(needed) else { return Ok(()) };
    Err(BssrdfError::Entry {
        file: dataset.responses.path().to_path_buf(),
        place: "responses".into(),
        found: format!(
            "{} × {} texels with windows of {} × {}, {needs}",
            dataset.width, dataset.height, dataset.window[0], dataset.window[1]
        ),
        expected,
    })
}

/// Values per ring and texel at the end of a round: ln P, gradient, step, the solver's own, what was measured.
const PLANES_PER_RING: usize = 12;

/// What `factor` writes.
pub const OWNER: Owner = Owner {
    command: "factor",
    names: &[
        "profiles/",
        PROFILES,
        LABELS,
        "albedo.png",
        "clusters.png",
        "palette.png",
        "residual.png",
        RECIPROCITY,
        slab::MESH,
        slab::JOB,
        slab::REFINED,
        FACTORED,
    ],
};

/// A channel's name as a part of a file's.
fn file_part(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}
