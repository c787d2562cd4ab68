"""How far each label can be trusted, learned without truth from what scans say of the places that they share."""
