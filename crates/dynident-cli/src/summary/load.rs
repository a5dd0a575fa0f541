use super::text::{name, table, with_deviation, wrapped};
use dynident::ResultFile;
use dynident::identification::payload::{Measured, PayloadResult};

pub(super) fn loads(r: &ResultFile) -> String {
    let mut text = String::new();
    for payload in &r.payloads {
        text.push('\n');
        text += &of_payload(payload);
    }
    if !r.payloads.is_empty() && r.drive_gains.is_none() && r.method.gain_std_percent.is_none() {
        let words = "the payload's error bars assume exact torque gains; set drive.gain_std_percent to their \
                     uncertainty, or drive.gains = \"unknown\" to estimate them with a known weight";
        text += &wrapped(words, 2);
    }
    if let Some(gains) = &r.drive_gains {
        let header = ["drive gain", "Nm per logged unit", "+- (95 %)"].map(str::to_owned);
        let rows = gains.iter().map(|gain| {
            let [value, half] = with_deviation(gain.gain, gain.half_width_95);
            vec![name(&gain.joint), value, half]
        });
        text.push('\n');
        text += &table(&header, 1..3, rows.collect());
        for gain in gains {
            if let Some(reason) = &gain.reason {
                text += &wrapped(&format!("{}: gain NOT identified: {reason}", gain.joint), 2);
            }
        }
    }
    text
}

fn of_payload(payload: &PayloadResult) -> String {
    let figures: [(&str, Option<Measured>, &str); 10] = [
        ("mass", payload.mass_kg, "kg"),
        ("centre of mass x", payload.com_m[0], "m"),
        ("y", payload.com_m[1], "m"),
        ("z", payload.com_m[2], "m"),
        ("inertia there xx", payload.inertia_at_com_kgm2[0], "kg m^2"),
        ("xy", payload.inertia_at_com_kgm2[1], "kg m^2"),
        ("xz", payload.inertia_at_com_kgm2[2], "kg m^2"),
        ("yy", payload.inertia_at_com_kgm2[3], "kg m^2"),
        ("yz", payload.inertia_at_com_kgm2[4], "kg m^2"),
        ("zz", payload.inertia_at_com_kgm2[5], "kg m^2"),
    ];
    let rows: Vec<Vec<String>> = figures
        .into_iter()
        .filter_map(|(figure, measured, unit)| {
            let measured = measured?;
            let [value, half] = with_deviation(measured.value, measured.half_width_95);
            Some(vec![figure.to_owned(), value, half, unit.to_owned()])
        })
        .collect();
    let title = format!("payload {} at {}", name(&payload.name), name(&payload.link));
    let mut text = if rows.is_empty() {
        wrapped(
            &format!(
                "{title}: mass and centre of mass are not determined separately; result.json contains their determined combinations"
            ),
            2,
        )
    } else {
        table(&[title, "value".to_owned(), "+- (95 %)".to_owned(), "unit".to_owned()], 1..3, rows)
    };
    if !payload.not_identified.is_empty() {
        text += &wrapped(&format!("not identified: {}", payload.not_identified.join("; ")), 2);
    }
    if let Some(reason) = &payload.failure {
        text += &wrapped(&format!("no physically consistent body: {reason}"), 2);
    }
    text
}
