use super::text::{name, table, wrapped};
use dynident::result::FactorsFile;

const DIGITS: usize = 8;
const MAX_LISTED: usize = 40;

pub(crate) fn factors(file: &FactorsFile) -> String {
    let rows: u64 = file.logs.iter().map(|log| log.rows).sum();
    let count = file.logs.len();
    let logs = if count == 1 { "1 log".to_owned() } else { format!("{count} logs") };
    let size = file.bytes.div_ceil(1000);
    let mut text = wrapped(&format!("{}: {logs} of {}, {rows} rows, {size} kB", file.file, file.robot), 2);
    let row = |log: &dynident::result::FactorsLog| {
        let or_none = |value: &Option<String>| value.as_deref().unwrap_or("-").to_owned();
        let digits = log.sha256.get(..DIGITS).unwrap_or_default().to_owned();
        vec![name(&log.name), name(&or_none(&log.arm)), or_none(&log.recorded_at), digits, log.rows.to_string()]
    };
    let header = ["log", "arm", "recorded", "hash", "rows"].map(str::to_owned);
    text += &table(&header, 4..5, file.logs.iter().take(MAX_LISTED).map(row).collect());
    if count > MAX_LISTED {
        text += &wrapped(&format!("  and {} more", count - MAX_LISTED), 2);
    }
    text
}
