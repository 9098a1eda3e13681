"""Every table of the paper and of its planned comparison, from one ``StudyData``."""
