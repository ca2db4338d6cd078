//! The material meshes of a job, as STL and 3MF.

use crate::{
    job::{Prepared, RunError, file::OutputFormat, manifest::MeshRecord},
    output::{OutputError, OutputFolder},
    slice::meshes::{MaterialMesher, MaterialPart, MeshingError, write_3mf, write_stl},
    watch::Watch,
    words::short,
};

impl Prepared {
    /// Writes the material meshes the job asks for. They are of the whole job, whatever slices are written.
    pub(super) fn write_meshes(&self, output: &OutputFolder, watch: &dyn Watch) -> Result<Vec<MeshRecord>, RunError> {
        let (stl, assembly) = (self.job.wants(OutputFormat::Stl), self.job.wants(OutputFormat::ThreeMf));
        if !stl && !assembly {
            return Ok(Vec::new());
        }
        let mesher = self.mesher();
        let resins: Vec<_> = self.printed().map(|(id, resin)| (id, self.materials[resin].name.clone())).collect();
        watch.stage("meshes", 0);
        let meshes = mesher.mesh(self.slicer().objects(), &resins, watch)?;
        let encoding = |error: std::io::Error| OutputError::Io {
            action: "encoding",
            path: output.root().join("meshes"),
            source: error,
        };
        let parts = || meshes.parts.iter().filter(|part| !part.triangles.is_empty());
        if stl {
            for part in parts() {
                let mut file = Vec::new();
                write_stl(&meshes, part, &mut file).map_err(encoding)?;
                output.write(&format!("meshes/{}.stl", part.name), &file)?;
            }
        }
        if assembly {
            let mut file = std::io::Cursor::new(Vec::new());
            write_3mf(&meshes, &self.palette, &mut file).map_err(encoding)?;
            output.write(&format!("meshes/{}.3mf", self.job.name), file.get_ref())?;
        }
        let record = |part: &MaterialPart| MeshRecord {
            material: part.name.clone(),
            triangles: part.triangles.len() as u64,
            volume_mm3: part.volume_mm3,
            pitch_mm: mesher.pitch_mm,
            error_mm: mesher.error_mm,
        };
        Ok(parts().map(record).collect())
    }

    fn mesher(&self) -> MaterialMesher {
        let layers = self.objects.iter().flat_map(|object| &object.stackings.stackings).flat_map(|entry| &entry.layers);
        let thinnest = layers.map(|layer| layer.thickness_mm).reduce(f64::min);
        let default = MaterialMesher::default_pitch_mm(thinnest, self.lattice.pitch);
        let pitch_mm = self.job.output.mesh_pitch_mm.unwrap_or(default);
        let error_mm = self.job.output.mesh_error_mm.unwrap_or_else(|| MaterialMesher::default_error_mm(pitch_mm));
        MaterialMesher { pitch_mm, error_mm }
    }

    /// Refuses what would make the material meshes fail once all slices are written.
    pub(in crate::job) fn check_meshes(&self) -> Result<(), RunError> {
        if self.job.wants(OutputFormat::Stl) || self.job.wants(OutputFormat::ThreeMf) {
            self.mesher().check(self.slicer().objects()).map_err(|error| match error {
                MeshingError::TooFine { pitch_mm, axis, nodes, max } => {
                    let found = format!("{} mm, which makes {nodes:.0} nodes along {axis}", short(pitch_mm));
                    self.job.refuse("output.mesh-pitch-mm", found, format!("at most {max} nodes")).into()
                }
                other => RunError::from(other),
            })?;
        }
        Ok(())
    }
}
