//! An edge node or a host application built with srad: `srad-peer edge HOST PORT GROUP NODE PRIMARY_HOST` or `srad-peer host HOST PORT
//! GROUP HOST_ID`. The language on stdin and stdout is that of tests/peers/process.py. Its edge node knows no primary host.

mod edge;
mod host;

use serde_json::{json, Value};
use srad::client_rumqtt::{EventLoop, MqttOptions};
use srad::types::payload::DataType;
use srad::types::{MetricValue, MetricValueKind};
use tokio::io::{AsyncBufReadExt, BufReader, Lines, Stdin};

pub type Input = Lines<BufReader<Stdin>>;

/// Write one line.
pub fn say(event: &str, device: Option<&str>, metrics: Vec<Value>) {
    println!(
        "{}",
        json!({"event": event, "device": device, "metrics": metrics})
    );
}

/// Return the next line of the test.
pub async fn hear(input: &mut Input) -> Option<Value> {
    let line = input.next_line().await.unwrap()?;
    Some(serde_json::from_str(&line).unwrap())
}

/// Return the datatype of a name as the specification spells it.
pub fn datatype(name: &str) -> DataType {
    match name {
        "UUID" => DataType::Uuid,
        "DataSet" => DataType::DataSet,
        _ => DataType::from_str_name(name).unwrap_or_else(|| panic!("no datatype {name}")),
    }
}

/// Return the name of a datatype as the specification spells it.
pub fn name_of(datatype: DataType) -> &'static str {
    match datatype {
        DataType::Uuid => "UUID",
        other => other.as_str_name(),
    }
}

/// Return a value as a test writes it.
pub fn told(datatype: DataType, value: Option<MetricValue>) -> Value {
    let Some(value) = value else {
        return Value::Null;
    };
    match MetricValueKind::try_from_metric_value(datatype, value) {
        Ok(MetricValueKind::Int8(v)) => json!(v.to_string()),
        Ok(MetricValueKind::Int16(v)) => json!(v.to_string()),
        Ok(MetricValueKind::Int32(v)) => json!(v.to_string()),
        Ok(MetricValueKind::Int64(v)) => json!(v.to_string()),
        Ok(MetricValueKind::UInt8(v)) => json!(v.to_string()),
        Ok(MetricValueKind::UInt16(v)) => json!(v.to_string()),
        Ok(MetricValueKind::UInt32(v)) => json!(v.to_string()),
        Ok(MetricValueKind::UInt64(v)) => json!(v.to_string()),
        Ok(MetricValueKind::Float(v)) => json!((v as f64).to_string()),
        Ok(MetricValueKind::Double(v)) => json!(v.to_string()),
        Ok(MetricValueKind::Boolean(v)) => json!(v.to_string()),
        Ok(MetricValueKind::String(v) | MetricValueKind::Text(v) | MetricValueKind::Uuid(v)) => {
            json!(v)
        }
        Ok(MetricValueKind::DateTime(v)) => json!(v.date_time.to_string()),
        Ok(MetricValueKind::Bytes(v) | MetricValueKind::File(v)) => json!(hex(&v)),
        Ok(MetricValueKind::DataSet(v)) => host::table(v),
        Ok(MetricValueKind::Template(v)) => host::template(v),
        Ok(other) => json!(format!("{other:?}")),
        Err(error) => json!(format!("unreadable: {error}")),
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[tokio::main(flavor = "current_thread")]
async fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let input = BufReader::new(tokio::io::stdin()).lines();
    let id = format!("srad-{}", arguments[4]);
    let mut options = MqttOptions::new(id, arguments[1].clone(), arguments[2].parse().unwrap());
    options.set_keep_alive(std::time::Duration::from_secs(5));
    let (eventloop, client) = EventLoop::new(options, 0);
    if arguments[0] == "edge" {
        edge::run(eventloop, client, &arguments[3], &arguments[4], input).await;
    } else {
        host::run(eventloop, client, &arguments[3], &arguments[4], input).await;
    }
}
