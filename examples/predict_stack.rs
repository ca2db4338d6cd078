//! What does a stack of resins look like? `cargo run --release --example predict_stack -- "white:0.5,support:1.0"`

use lumislice::{
    optics::{Light, MaterialSet, Model, Stack, TransportOptions, predict},
    watch::Unwatched,
};

#[allow(clippy::print_stdout)] // a program answers on stdout
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let layers = std::env::args().nth(1).unwrap_or_else(|| "white:0.5,support:1.0".to_owned());
    let set = MaterialSet::builtin("synthetic")?;
    let named: Stack<String> = layers.parse()?;
    let stack = set.stack(&named)?.over(set.resin("black").map(|(id, _)| id));
    let transport = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
    for (name, model) in [("Kubelka-Munk", Model::KubelkaMunk), ("transport", transport)] {
        let light = predict(&set, &stack, &model, &Unwatched)?.light.remove(0);
        let radius = light.radius_of_energy_mm(0.5).map_or("out of reach".to_owned(), |mm| format!("{mm:.3} mm"));
        println!("{name}: albedo {:.4}, half of the light within {radius}", light.reflection_hankel[0]);
    }
    Ok(())
}
