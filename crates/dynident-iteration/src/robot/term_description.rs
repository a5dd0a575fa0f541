use dynident_model::Model;
use dynident_model::terms::{CoulombShape, TermConstant, TorqueTerm};
use serde_json::{Value, json};

/// The term with the names of its joints, its constants and its parameter.
pub(super) fn describe(model: &Model, term: &TorqueTerm, value: f64) -> Value {
    let name = |joint: usize| &model.joints()[joint].name;
    let mut out = json!({ "kind": term.kind_name() });
    for (key, constant) in term.constants() {
        out[key] = match constant {
            TermConstant::Number(number, _) => json!(number),
            TermConstant::Numbers(numbers) => json!(numbers),
            TermConstant::Word(word) => json!(word),
            TermConstant::Text(text) => json!(text),
            TermConstant::Points(points) => json!(points),
            TermConstant::Step(step) => shape(step),
            TermConstant::Nothing => Value::Null,
        };
    }
    out["joints"] = term.joints().into_iter().map(|joint| json!(name(joint))).collect();
    out["symbol"] = json!(term.symbol());
    out["unit"] = json!(term.unit());
    out["value"] = json!(value);
    out
}

fn shape(shape: CoulombShape) -> Value {
    match shape {
        CoulombShape::Sign { dead_band } => json!({ "step": "sign", "dead_band": dead_band }),
        CoulombShape::Smooth { width } => json!({ "step": "smooth", "width": width }),
    }
}
