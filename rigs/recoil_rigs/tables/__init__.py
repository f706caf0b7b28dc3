"""Tables of a rig file as they are declared: sensors and forces, issue, certificates, specification."""
