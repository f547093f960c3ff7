//! CAN interfaces of this machine.

use hachi_canbus::BusError;

use crate::service::emergency_stop::Bus;

/// Opens an interface for frames under these identifiers.
///
/// # Errors
/// There is none, or the system has no CAN.
#[cfg(target_os = "linux")]
pub fn open(interface: &str, ids: &[u16]) -> Result<Bus, BusError> {
    let bus = hachi_canbus::device::SocketCan::open_for(interface, ids)?;
    Ok(Box::new(bus))
}

/// Opens an interface for frames under these identifiers.
///
/// # Errors
/// The system has no CAN.
#[cfg(not(target_os = "linux"))]
pub fn open(interface: &str, _ids: &[u16]) -> Result<Bus, BusError> {
    Err(BusError::Open {
        interface: interface.to_owned(),
        source: std::io::ErrorKind::Unsupported.into(),
    })
}
