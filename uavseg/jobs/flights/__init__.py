"""Jobs over missions: plan, check, upload and download."""
